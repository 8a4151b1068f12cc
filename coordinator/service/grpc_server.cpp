#include "coordinator/service/grpc_server.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <string_view>
#include <utility>

#include "common/base/files.h"
#include "common/base/log.h"
#include "glint/glint.grpc.pb.h"
#include "worker/execution_id.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr size_t kPieceBytes = size_t{1} << 20;  ///< of uploads and downloads
constexpr int kMaxMessageBytes = 2 << 20;
constexpr size_t kMaxRequestBytes = 64 << 10;
constexpr int kMaxScenesAsked = 1000;
constexpr int kMaxUploads = 2;  ///< at a time: each stands in memory
constexpr int kMaxThreads = 64;
constexpr auto kWatchPeriod = std::chrono::milliseconds(500);

// ---- Between our words and gRPC's ----

grpc::StatusCode ToCode(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::kOk:
      return grpc::StatusCode::OK;
    case ErrorKind::kUsage:
    case ErrorKind::kBadInput:
      return grpc::StatusCode::INVALID_ARGUMENT;
    case ErrorKind::kLimit:
      return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case ErrorKind::kInterrupted:
      return grpc::StatusCode::CANCELLED;
    case ErrorKind::kIo:
      return grpc::StatusCode::UNAVAILABLE;
    case ErrorKind::kMismatch:
      return grpc::StatusCode::DATA_LOSS;
    case ErrorKind::kInternal:
      return grpc::StatusCode::INTERNAL;
  }
  return grpc::StatusCode::INTERNAL;
}

/// The kind travels beside the code, which is coarser.
grpc::Status ToGrpc(grpc::ServerContext* context, const Status& status) {
  if (status.ok()) return grpc::Status::OK;
  context->AddTrailingMetadata("glint-kind", std::to_string(static_cast<int>(status.kind())));
  return {ToCode(status.kind()), status.message()};
}

std::optional<Digest> ToDigest(const std::string& bytes) {
  Digest digest;
  if (bytes.size() != digest.bytes.size()) return std::nullopt;
  std::copy(bytes.begin(), bytes.end(), digest.bytes.begin());
  return digest;
}
std::string ToBytes(const Digest& digest) { return {digest.bytes.begin(), digest.bytes.end()}; }

void Fill(const BakeStatus& status, v1::Bake* out) {
  const JournalEntry& entry = status.entry;
  out->set_id(entry.id);
  out->set_name(entry.request.name);
  out->set_state(static_cast<v1::State>(entry.state));
  out->set_error_kind(static_cast<int>(entry.error.kind()));
  out->set_error(entry.error.message());
  out->set_submitted_unix(entry.submitted_unix);
  out->set_archive_bytes(status.archive_bytes);
  if (entry.state != BakeState::kRunning) return;
  out->set_stage(status.progress.stage);
  out->set_tasks_done(status.progress.done);
  out->set_tasks(status.progress.tasks);
  out->set_slices_per_second(status.progress.slices_per_second);
  out->set_seconds_left(status.progress.seconds_left);
  for (const WorkerProgress& worker : status.progress.workers) {
    v1::Worker* const to = out->add_workers();
    to->set_name(worker.name);
    to->set_tasks(worker.tasks);
    to->set_seconds(worker.seconds);
  }
}
static_assert(static_cast<int>(v1::QUEUED) == static_cast<int>(BakeState::kQueued) &&
              static_cast<int>(v1::RUNNING) == static_cast<int>(BakeState::kRunning) &&
              static_cast<int>(v1::DONE) == static_cast<int>(BakeState::kDone) &&
              static_cast<int>(v1::FAILED) == static_cast<int>(BakeState::kFailed) &&
              static_cast<int>(v1::CANCELLED) == static_cast<int>(BakeState::kCancelled));

/// Sends a file: digest and size, then its bytes.
template <class Writer>
Status SendFile(const fs::path& path, Writer* writer) {
  GLINT_ASSIGN_OR_RETURN(const MappedFile file, MappedFile::Open(path));
  v1::FetchReply reply;
  reply.mutable_header()->set_digest(ToBytes(Sha256(file.bytes())));
  reply.mutable_header()->set_size(file.bytes().size());
  bool listening = writer->Write(reply);
  for (size_t at = 0; listening && at < file.bytes().size(); at += kPieceBytes) {
    const auto piece = file.bytes().subspan(at, std::min(kPieceBytes, file.bytes().size() - at));
    reply.set_bytes(piece.data(), piece.size());
    listening = writer->Write(reply);
  }
  return listening ? Status() : Interrupted("the client went away");
}

/// Receives a scene: no more memory than its header said, and no more than `limit`.
template <class Reader>
Result<std::pair<Digest, std::vector<std::byte>>> ReceiveScene(Reader* reader, uint64_t limit) {
  v1::UploadRequest part;
  if (!reader->Read(&part) || !part.has_header()) return BadInput("an upload begins with digest and size");
  const std::optional<Digest> digest = ToDigest(part.header().digest());
  if (!digest) return BadInput("a digest has 32 bytes");
  const uint64_t size = part.header().size();
  if (size > limit) {
    return LimitExceeded("a scene of " + std::to_string(size) + " bytes, more than this service's " +
                         std::to_string(limit) + " (glint serve --max-scene)");
  }
  std::vector<std::byte> bytes;
  while (reader->Read(&part)) {
    const auto piece = std::as_bytes(std::span(part.bytes()));
    if (piece.size() > size - bytes.size()) return BadInput("an upload is longer than its header says");
    bytes.insert(bytes.end(), piece.begin(), piece.end());
  }
  if (bytes.size() != size) return BadInput("an upload is shorter than its header says; send it again");
  return std::pair(*digest, std::move(bytes));
}

// ---- The calls ----

class Calls final : public v1::Glint::Service {
 public:
  Calls(BakeService* service, std::optional<TokenList> tokens)
      : service_(*service), tokens_(std::move(tokens)) {}
  /// Ends calls that would go on.
  void End() { ending_ = true; }

 private:
  using Context = grpc::ServerContext;

  // ---- Who may call ----

  /// Does a call's work if its client has the right to it.
  template <class Body>
  grpc::Status As(Right needed, const char* call, Context* context, const Body& body) const {
    if (const std::optional<grpc::Status> refused = Refuse(needed, call, context)) return *refused;
    return ToGrpc(context, body());
  }

  /// None: the client may.
  std::optional<grpc::Status> Refuse(Right needed, const char* call, Context* context) const {
    if (!tokens_) return std::nullopt;
    const TokenList::Client* client = tokens_->Find(BearerToken(*context));
    const bool may = client && client->right >= needed;
    if (!may || needed > Right::kRead) {
      const std::string name = client ? client->name : "";
      Log(may ? LogLevel::kNote : LogLevel::kWarning,
          (client ? "client '" + name + "'" : "an unknown client at " + context->peer()) +
              (may ? " calls " : " may not call ") + call,
          {{"client", name}, {"call", call}, {"peer", context->peer()}});
    }
    if (may) return std::nullopt;
    context->AddTrailingMetadata("glint-kind", std::to_string(static_cast<int>(ErrorKind::kUsage)));
    if (!client)
      return grpc::Status(grpc::StatusCode::UNAUTHENTICATED,
                          "the service knows its clients by tokens, and not this one; give --token-file");
    return grpc::Status(grpc::StatusCode::PERMISSION_DENIED, std::string(call) + " needs the right '" +
                                                                 RightName(needed) + "', which '" +
                                                                 client->name + "' does not have");
  }

  /// Empty: there is none.
  static std::string BearerToken(const Context& context) {
    constexpr std::string_view kScheme = "Bearer ";
    const auto header = context.client_metadata().find("authorization");
    if (header == context.client_metadata().end()) return "";
    const std::string_view value(header->second.data(), header->second.size());
    return std::string(value.starts_with(kScheme) ? value.substr(kScheme.size()) : std::string_view());
  }

  // ---- What they call ----

  grpc::Status Health(Context* context, const v1::HealthRequest*, v1::HealthReply* reply) override {
    return As(Right::kRead, "Health", context, [&] {
      reply->set_version(GLINT_VERSION);
      reply->set_execution(ExecutionId());
      for (const BakeStatus& bake : service_.List()) {
        if (bake.entry.state == BakeState::kQueued) reply->set_queued(reply->queued() + 1);
        if (bake.entry.state == BakeState::kRunning) reply->set_running(reply->running() + 1);
      }
      return Status();
    });
  }

  grpc::Status FindMissing(Context* context, const v1::FindMissingRequest* request,
                           v1::FindMissingReply* reply) override {
    return As(Right::kSubmit, "FindMissing", context, [&]() -> Status {
      if (request->scenes_size() > kMaxScenesAsked)
        return LimitExceeded("more than 1000 scenes in one question");
      for (const std::string& scene : request->scenes()) {
        const std::optional<Digest> digest = ToDigest(scene);
        if (!digest) return BadInput("a digest has 32 bytes");
        if (!service_.HasScene(*digest)) reply->add_scenes(scene);
      }
      return {};
    });
  }

  grpc::Status Upload(Context* context, grpc::ServerReader<v1::UploadRequest>* reader,
                      v1::UploadReply*) override {
    return As(Right::kSubmit, "Upload", context, [&] {
      const bool room = ++uploads_ <= kMaxUploads;
      Status stored = room ? Receive(reader) : IoError("other scenes are being uploaded; try again");
      --uploads_;
      return stored;
    });
  }
  Status Receive(grpc::ServerReader<v1::UploadRequest>* reader) {
    const auto scene = ReceiveScene(reader, service_.max_scene_bytes());
    return scene.ok() ? service_.PutScene(scene->first, scene->second) : scene.status();
  }

  grpc::Status Submit(Context* context, const v1::SubmitRequest* request, v1::Bake* reply) override {
    return As(Right::kSubmit, "Submit", context, [&]() -> Status {
      if (request->request().size() > kMaxRequestBytes) return LimitExceeded("a request of more than 64 KiB");
      GLINT_ASSIGN_OR_RETURN(const BakeRequest parsed, ParseRequest(request->request()));
      return Reply(service_.Submit(parsed), reply);
    });
  }

  grpc::Status List(Context* context, const v1::ListRequest*, v1::ListReply* reply) override {
    return As(Right::kRead, "List", context, [&] {
      for (const BakeStatus& bake : service_.List()) Fill(bake, reply->add_bakes());
      return Status();
    });
  }

  grpc::Status Get(Context* context, const v1::BakeRequest* request, v1::Bake* reply) override {
    return As(Right::kRead, "Get", context, [&] { return Reply(service_.Get(request->id()), reply); });
  }
  grpc::Status Cancel(Context* context, const v1::BakeRequest* request, v1::Bake* reply) override {
    return As(Right::kSubmit, "Cancel", context,
              [&] { return Reply(service_.Cancel(request->id()), reply); });
  }
  grpc::Status Resume(Context* context, const v1::BakeRequest* request, v1::Bake* reply) override {
    return As(Right::kSubmit, "Resume", context,
              [&] { return Reply(service_.Resume(request->id()), reply); });
  }
  grpc::Status Delete(Context* context, const v1::BakeRequest* request, v1::DeleteReply*) override {
    return As(Right::kAdmin, "Delete", context, [&] { return service_.Delete(request->id()); });
  }

  grpc::Status Watch(Context* context, const v1::BakeRequest* request,
                     grpc::ServerWriter<v1::Bake>* writer) override {
    return As(Right::kRead, "Watch", context, [&] { return SendChanges(context, request->id(), writer); });
  }
  Status SendChanges(Context* context, const std::string& id, grpc::ServerWriter<v1::Bake>* writer) {
    Result<BakeStatus> status = service_.Get(id);
    for (bool listening = true; listening && status.ok();) {
      v1::Bake message;
      Fill(*status, &message);
      listening = writer->Write(message);
      const uint64_t seen = status->version;
      if (message.state() != v1::QUEUED && message.state() != v1::RUNNING) return {};
      // Not more often than a person can follow; and to notice clients that have gone.
      do {
        status = service_.Await(id, seen, kWatchPeriod);
        if (ending_) return IoError("the service ends; it takes the bake up when it is started again");
      } while (status.ok() && status->version == seen && !context->IsCancelled());
      listening = listening && !context->IsCancelled();
    }
    return status.status();
  }

  grpc::Status Fetch(Context* context, const v1::FetchRequest* request,
                     grpc::ServerWriter<v1::FetchReply>* writer) override {
    return As(Right::kRead, "Fetch", context, [&]() -> Status {
      const bool report = request->what() == v1::FetchRequest::REPORT;
      GLINT_ASSIGN_OR_RETURN(const fs::path path, service_.ResultFile(request->id(), report));
      return SendFile(path, writer);
    });
  }

  static Status Reply(const Result<BakeStatus>& status, v1::Bake* reply) {
    if (status.ok()) Fill(*status, reply);
    return status.status();
  }

  BakeService& service_;
  const std::optional<TokenList> tokens_;
  std::atomic<int> uploads_{0};
  std::atomic<bool> ending_{false};
};

// ---- Listening ----

bool IsLoopback(const std::string& listen) {
  const std::string host = listen.substr(0, listen.rfind(':'));
  return host == "127.0.0.1" || host == "[::1]" || host == "localhost";
}

Result<std::string> ReadText(const std::string& path) {
  constexpr uint64_t kMaxPemBytes = 1 << 20;
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, kMaxPemBytes));
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

/// Nobody but this machine's users, or whoever shows a certificate of the clients' authority.
Result<std::shared_ptr<grpc::ServerCredentials>> MakeCredentials(const ServerOptions& options) {
  const bool any = !options.cert_file.empty() || !options.key_file.empty() || !options.client_ca_file.empty();
  const bool all = !options.cert_file.empty() && !options.key_file.empty() && !options.client_ca_file.empty();
  if (any != all)
    return UsageError("TLS needs all three: the service's certificate, its key, and the clients' authority");
  if (!any && !IsLoopback(options.listen)) {
    return UsageError("--listen " + options.listen +
                      " can be reached from other machines: give --tls-cert, "
                      "--tls-key and --tls-client-ca, or listen on 127.0.0.1");
  }
  if (!any) return grpc::InsecureServerCredentials();
  grpc::SslServerCredentialsOptions tls(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  GLINT_ASSIGN_OR_RETURN(tls.pem_root_certs, ReadText(options.client_ca_file));
  GLINT_ASSIGN_OR_RETURN(const std::string key, ReadText(options.key_file));
  GLINT_ASSIGN_OR_RETURN(const std::string cert, ReadText(options.cert_file));
  tls.pem_key_cert_pairs.push_back({key, cert});
  return grpc::SslServerCredentials(tls);
}

class GrpcServerImpl : public GrpcServer {
 public:
  GrpcServerImpl(BakeService* service, std::optional<TokenList> tokens)
      : calls_(service, std::move(tokens)) {}
  ~GrpcServerImpl() override {
    calls_.End();
    if (server_) server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(2));
  }
  Status Listen(const ServerOptions& options) {
    GLINT_ASSIGN_OR_RETURN(const std::shared_ptr<grpc::ServerCredentials> credentials,
                           MakeCredentials(options));
    grpc::ServerBuilder builder;
    builder.AddListeningPort(options.listen, credentials, &port_);
    builder.RegisterService(&calls_);
    builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
    builder.SetResourceQuota(grpc::ResourceQuota().SetMaxThreads(kMaxThreads));
    // Two services on one address would share its clients between them.
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    server_ = builder.BuildAndStart();
    if (server_ && port_ != 0) return {};
    return UsageError("cannot listen on " + options.listen + "; is it in use, or are the keys not PEM?");
  }
  int port() const override { return port_; }

 private:
  Calls calls_;
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
};

}  // namespace

Result<std::unique_ptr<GrpcServer>> GrpcServer::Start(const ServerOptions& options, BakeService* service) {
  auto server = std::make_unique<GrpcServerImpl>(service, options.tokens);
  GLINT_RETURN_IF_ERROR(server->Listen(options));
  return std::unique_ptr<GrpcServer>(std::move(server));
}

}  // namespace glint
