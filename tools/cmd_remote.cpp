// The commands that talk to a service.

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <thread>

#include "common/base/log.h"
#include "common/base/steady_clock.h"
#include "tools/bake_words.h"
#include "tools/client.h"
#include "tools/commands.h"
#include "tools/service_words.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr double kPatience = 60;  ///< seconds that a service which is being started again is waited for

const char* StateName(BakeState state) {
  switch (state) {
    case BakeState::kQueued:
      return "queued";
    case BakeState::kRunning:
      return "running";
    case BakeState::kDone:
      return "done";
    case BakeState::kFailed:
      return "failed";
    case BakeState::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

nlohmann::ordered_json ToJson(const RemoteBake& bake) {
  nlohmann::ordered_json json = {{"id", bake.id},
                                 {"name", bake.name},
                                 {"state", StateName(bake.state)},
                                 {"submitted", bake.submitted_unix}};
  if (bake.state == BakeState::kRunning) {
    nlohmann::ordered_json workers = nlohmann::ordered_json::array();
    for (const WorkerProgress& worker : bake.workers)
      workers.push_back({{"name", worker.name}, {"tasks", worker.tasks}, {"seconds", worker.seconds}});
    json.update({{"stage", bake.stage},
                 {"tasks_done", bake.tasks_done},
                 {"tasks", bake.tasks},
                 {"slices_per_second", bake.slices_per_second},
                 {"seconds_left", bake.seconds_left},
                 {"workers", workers}});
  }
  if (bake.state == BakeState::kDone) json["archive_bytes"] = bake.archive_bytes;
  if (bake.state == BakeState::kFailed)
    json.update({{"error_kind", static_cast<int>(bake.error.kind())}, {"error", bake.error.message()}});
  return json;
}

std::string Describe(const WorkerProgress& worker) {
  char text[80];
  std::snprintf(text, sizeof text, " %llu tasks, %.0f s", static_cast<unsigned long long>(worker.tasks),
                worker.seconds);
  return worker.name + text;
}

std::string Describe(const RemoteBake& bake) {
  std::string text = bake.id + "  " + StateName(bake.state) + "  " + bake.name;
  if (bake.state == BakeState::kFailed) text += "  " + bake.error.message();
  if (bake.state != BakeState::kRunning) return text;
  text += "  " + bake.stage;
  if (bake.tasks == 0) return text;
  char progress[80];
  std::snprintf(progress, sizeof progress, ": %.0f %%",
                100.0 * static_cast<double>(bake.tasks_done) / static_cast<double>(bake.tasks));
  text += progress;
  if (bake.seconds_left <= 0) return text;
  std::snprintf(progress, sizeof progress, ", %.0f s left", bake.seconds_left);
  return text + progress;
}

/// What a round's workers have done, as far as it fits into a line.
std::string DescribeWorkers(const RemoteBake& bake) {
  constexpr size_t kNamed = 4;
  if (bake.workers.size() > kNamed) return "; " + std::to_string(bake.workers.size()) + " workers";
  std::string text;
  for (const WorkerProgress& worker : bake.workers) text += "; " + Describe(worker);
  return text;
}

void Print(const RemoteBake& bake, const CommonWords& common) {
  if (common.json) {
    PrintJson(ToJson(bake));
  } else {
    std::printf("%s\n", Describe(bake).c_str());
    for (const WorkerProgress& worker : bake.workers) std::printf("  %s\n", Describe(worker).c_str());
  }
}

/// What a bake that has ended means for who waited for it: its exit code.
Status EndOf(const RemoteBake& bake) {
  if (bake.state == BakeState::kFailed) return bake.error.WithContext("bake " + bake.id);
  if (bake.state == BakeState::kCancelled)
    return Interrupted("bake " + bake.id + " was cancelled; 'glint resume " + bake.id + "' goes on with it");
  return {};
}

using ShowBake = std::function<void(const RemoteBake&)>;

/// Shows each new stage at once, and what happens inside it at a pace that a person or a log file can take.
ShowBake AtReadingPace() {
  return [watch = Stopwatch(), next = 0.0, stage = std::string()](const RemoteBake& bake) mutable {
    const std::string now = StateName(bake.state) + bake.stage;
    if (now == stage && watch.Seconds() < next) return;
    stage = now;
    next = watch.Seconds() + (isatty(STDERR_FILENO) == 1 ? 0.1 : 10.0);
    Log(LogLevel::kProgress, Describe(bake) + DescribeWorkers(bake));
  };
}

/// For programs: every change, an object a line.
void ShowAsLine(const RemoteBake& bake) {
  std::printf("%s\n", ToJson(bake).dump().c_str());
  std::fflush(stdout);
}

/// Watches a bake to its end, through services that end and come again.
Result<RemoteBake> WatchToEnd(ServiceClient* client, const std::string& id, const ShowBake& show) {
  const Stopwatch silent;
  double heard = 0;
  for (;;) {
    Result<RemoteBake> watched = client->Watch(id, [&](const RemoteBake& bake) {
      heard = silent.Seconds();
      show(bake);
    });
    const bool again = watched.status().kind() == ErrorKind::kIo && silent.Seconds() - heard < kPatience;
    if (!again || StopRequested()) return watched;
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }
}

// ---- submit ----

struct SubmitWords {
  std::string scene, output, key;
  bool wait = false;
  ClientOptions client;
  ClusterOptions cluster;
  BakeOptions options;
};

Status FetchResults(ServiceClient* client, const std::string& id, const std::string& output) {
  GLINT_RETURN_IF_ERROR(client->Fetch(id, false, output));
  GLINT_RETURN_IF_ERROR(client->Fetch(id, true, output + ".json"));
  Log(LogLevel::kNote, "wrote " + output + " and " + output + ".json");
  return {};
}

Status RunSubmit(const SubmitWords& words, const CommonWords& common) {
  if (!words.output.empty() && !words.wait)
    return UsageError("-o needs --wait; 'glint fetch' gets a result later");
  if (!words.output.empty()) GLINT_RETURN_IF_ERROR(CheckOutput(words.output, {".glint"}));
  GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<ServiceClient> client, ServiceClient::Connect(words.client));
  BakeRequest request;
  GLINT_ASSIGN_OR_RETURN(request.scene, client->Upload(words.scene));
  request.key = words.key;
  request.name = fs::path(words.scene).filename().string();
  request.settings = words.options.settings;
  request.target = words.options.target;
  request.max_layers = words.options.max_layers;
  request.layer_tolerance = words.options.layer_tolerance;
  request.table_form = words.options.table_form;
  request.estimate_slices = words.options.estimate_slices;
  request.vertices_per_task = words.options.vertices_per_task;
  request.directions_per_task = words.options.directions_per_task;
  request.priority = words.cluster.priority;
  GLINT_ASSIGN_OR_RETURN(RemoteBake bake, client->Submit(request));
  if (words.wait) {
    Log(LogLevel::kNote, "bake " + bake.id);
    GLINT_ASSIGN_OR_RETURN(bake, WatchToEnd(client.get(), bake.id, AtReadingPace()));
  }
  Print(bake, common);
  if (!words.wait) return {};
  GLINT_RETURN_IF_ERROR(EndOf(bake));
  return words.output.empty() ? Status() : FetchResults(client.get(), bake.id, words.output);
}

// ---- The others ----

struct RemoteWords {
  std::string id, output;
  ClientOptions client;
};
using RemoteBody = Status (*)(ServiceClient*, const RemoteWords&, const CommonWords&);

Status RunStatus(ServiceClient* client, const RemoteWords& words, const CommonWords& common) {
  if (!words.id.empty()) {
    GLINT_ASSIGN_OR_RETURN(const RemoteBake bake, client->Get(words.id));
    Print(bake, common);
    return {};
  }
  GLINT_ASSIGN_OR_RETURN(const std::vector<RemoteBake> bakes, client->List());
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const RemoteBake& bake : bakes) {
    list.push_back(ToJson(bake));
    if (!common.json) Print(bake, common);
  }
  if (common.json) PrintJson({{"bakes", list}});
  return {};
}

Status RunWatch(ServiceClient* client, const RemoteWords& words, const CommonWords& common) {
  GLINT_ASSIGN_OR_RETURN(const RemoteBake bake,
                         WatchToEnd(client, words.id, common.json ? ShowAsLine : AtReadingPace()));
  if (!common.json) Print(bake, common);
  return EndOf(bake);
}

Status RunCancel(ServiceClient* client, const RemoteWords& words, const CommonWords& common) {
  GLINT_ASSIGN_OR_RETURN(const RemoteBake bake, client->Cancel(words.id));
  Print(bake, common);
  return {};
}

Status RunResume(ServiceClient* client, const RemoteWords& words, const CommonWords& common) {
  GLINT_ASSIGN_OR_RETURN(const RemoteBake bake, client->Resume(words.id));
  Print(bake, common);
  return {};
}

Status RunDelete(ServiceClient* client, const RemoteWords& words, const CommonWords&) {
  return client->Delete(words.id);
}

Status RunFetch(ServiceClient* client, const RemoteWords& words, const CommonWords& common) {
  GLINT_RETURN_IF_ERROR(CheckOutput(words.output, {".glint"}));
  GLINT_RETURN_IF_ERROR(FetchResults(client, words.id, words.output));
  if (common.json)
    PrintJson({{"id", words.id}, {"archive", words.output}, {"report", words.output + ".json"}});
  return {};
}

/// A command on one bake, or without `required_id` perhaps on all.
Command AddRemote(CLI::App& app, CommonWords& common, bool required_id, RemoteBody body) {
  const auto words = std::make_shared<RemoteWords>();
  app.add_option("id", words->id, "The bake, as 'glint submit' named it")
      ->required(required_id)
      ->type_name("ID");
  if (body == RunFetch) {
    app.add_option("-o,--output", words->output, "Archive to write; the report goes to OUT.glint.json")
        ->required()
        ->type_name("OUT.glint");
  }
  AddClientWords(app, words->client);
  AddCommonWords(app, common);
  return [words, &common, body]() -> Status {
    GLINT_ASSIGN_OR_RETURN(const std::unique_ptr<ServiceClient> client,
                           ServiceClient::Connect(words->client));
    return body(client.get(), *words, common);
  };
}

}  // namespace

Command AddSubmitCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("submit", "Have a service bake a scene");
  const auto words = std::make_shared<SubmitWords>();
  app.add_option("scene", words->scene, "Scene: .glb, or .gltf with its data inside")
      ->required()
      ->type_name("SCENE");
  app.add_flag("--wait", words->wait, "Watch it to its end, with the exit code that 'glint bake' would have");
  app.add_option("-o,--output", words->output, "With --wait: archive to write")->type_name("OUT.glint");
  app.add_option("--key", words->key,
                 "A name of yours for this request: submitting it again gives the same bake")
      ->type_name("TEXT");
  AddClientWords(app, words->client);
  AddAccuracyWords(app, words->options);
  AddTaskWords(app, words->options);
  AddPriorityWord(app, words->cluster);
  AddCommonWords(app, common);
  app.footer(
      "The same request twice is one bake.\n"
      "\n"
      "Examples:\n"
      "  glint submit teapot.glb --to localhost:7117 --wait -o teapot.glint\n"
      "  glint submit teapot.glb --layers 2 --directions 2562 --priority 10");
  return [words, &common] { return RunSubmit(*words, common); };
}

Command AddStatusCommand(CLI::App& glint, CommonWords& common) {
  return AddRemote(*glint.add_subcommand("status", "Show a service's bakes"), common, false, RunStatus);
}
Command AddWatchCommand(CLI::App& glint, CommonWords& common) {
  return AddRemote(*glint.add_subcommand("watch", "Follow a service's bake to its end"), common, true,
                   RunWatch);
}
Command AddCancelCommand(CLI::App& glint, CommonWords& common) {
  return AddRemote(*glint.add_subcommand("cancel", "End a service's bake; what is finished stays"), common,
                   true, RunCancel);
}
Command AddResumeCommand(CLI::App& glint, CommonWords& common) {
  return AddRemote(*glint.add_subcommand("resume", "Go on with a bake that was cancelled or failed"), common,
                   true, RunResume);
}
Command AddFetchCommand(CLI::App& glint, CommonWords& common) {
  return AddRemote(*glint.add_subcommand("fetch", "Get the archive of a service's bake"), common, true,
                   RunFetch);
}
Command AddDeleteCommand(CLI::App& glint, CommonWords& common) {
  return AddRemote(*glint.add_subcommand("delete", "Have a service forget a bake and its archive"), common,
                   true, RunDelete);
}

}  // namespace glint
