// The traps of JetStream that this keeps clear of: de-duplication by message id would swallow what is
// published again after a loss, so messages have none; an emptied stream says nothing about results, so State
// is only ever a hint to publish again; deliveries are not limited, because the advisory that a message ran
// out of them is sent only while somebody asks for messages.
#include "common/queue/nats_queue.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <string_view>
#include <utility>

#include "common/queue/nats_connection.h"

namespace glint {
namespace {

constexpr char kStream[] = "BAKE";
constexpr char kSubjects[] = "bake.*.task.*";
constexpr int32_t kMaxMessageBytes = 256;                ///< ours have 65 to 84
constexpr int64_t kMaxStreamBytes = int64_t{256} << 20;  ///< a million of them
constexpr int64_t kMaxInFlight = 65'536;                 ///< of one bake, over all workers
constexpr int64_t kMaxRequests = 65'536;                 ///< of workers that wait for one bake
constexpr int64_t kConfirmMs = 10'000;
constexpr double kNanoseconds = 1e9;

using MessageHandle = NatsHandle<natsMsg, natsMsg_Destroy>;
using ConsumerHandle = NatsHandle<jsConsumerInfo, jsConsumerInfo_Destroy>;

/// @param shard  a number, or "*" for all of them
std::string Subject(const Digest& bake, const std::string& shard) {
  return "bake." + bake.Hex() + ".task." + shard;
}
std::string ConsumerName(const Digest& bake, uint32_t shard) {
  return bake.Hex() + "-" + std::to_string(shard);
}

// ---- What is said in text ----

/// "<manifest> <index>"
std::string ToText(const TaskMessage& message) {
  return message.manifest.Hex() + " " + std::to_string(message.index);
}

std::optional<TaskMessage> ParseMessage(std::string_view text) {
  constexpr size_t kHex = 64, kMaxDigits = 19;
  if (text.size() < kHex + 2 || text.size() > kHex + 1 + kMaxDigits || text[kHex] != ' ') return std::nullopt;
  const std::optional<Digest> manifest = Digest::FromHex(text.substr(0, kHex));
  if (!manifest) return std::nullopt;
  TaskMessage message{*manifest, 0};
  for (const char c : text.substr(kHex + 1)) {
    if (c < '0' || c > '9') return std::nullopt;
    message.index = 10 * message.index + static_cast<uint64_t>(c - '0');
  }
  return message;
}

/// libnats puts a description into JSON as it is: what JSON would take for its own is written as %XX.
std::string Escape(std::string_view text) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string escaped;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 32 || byte > 126 || c == '"' || c == '\\' || c == '%') {
      escaped += {'%', kDigits[byte >> 4], kDigits[byte & 15]};
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string Unescape(std::string_view text) {
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    int byte = 0;
    const bool escaped = text[i] == '%' && text.size() - i > 2 &&
                         std::from_chars(&text[i + 1], &text[i + 1] + 2, byte, 16).ptr == &text[i + 1] + 2;
    plain += escaped ? static_cast<char>(byte) : text[i];
    if (escaped) i += 2;
  }
  return plain;
}

/// "<priority> <shards> <execution>"
std::string Describe(const QueuedBake& bake) {
  return std::to_string(bake.priority) + " " + std::to_string(bake.shards) + " " + Escape(bake.execution);
}

/// The number at the beginning of `text`, and what follows it and a space; none: there is no number.
std::optional<uint32_t> TakeNumber(std::string_view* text) {
  uint32_t number = 0;
  const char* end = text->data() + text->size();
  const auto [next, error] = std::from_chars(text->data(), end, number);
  if (error != std::errc() || (next != end && *next != ' ')) return std::nullopt;
  text->remove_prefix(static_cast<size_t>(next - text->data()) + (next != end));
  return number;
}

/// One line of one of our bakes.
struct ShardConsumer {
  QueuedBake bake;  ///< without `messages`
  uint32_t shard = 0;
};

/// None if it is somebody else's.
std::optional<ShardConsumer> ParseConsumer(const jsConsumerInfo& info) {
  constexpr size_t kHex = 64;
  if (!info.Name || !info.Config || !info.Config->Description) return std::nullopt;
  std::string_view name = info.Name, description = info.Config->Description;
  if (name.size() < kHex + 2 || name[kHex] != '-') return std::nullopt;
  const std::optional<Digest> key = Digest::FromHex(name.substr(0, kHex));
  name.remove_prefix(kHex + 1);
  const std::optional<uint32_t> shard = TakeNumber(&name), priority = TakeNumber(&description),
                                shards = TakeNumber(&description);
  if (!key || !shard || !priority || !shards || *shards > kMaxShards || *shard >= *shards)
    return std::nullopt;
  return ShardConsumer{
      {*key, Unescape(description), std::clamp(static_cast<int>(std::min(*priority, 1000u)), 1, kMaxPriority),
       static_cast<double>(info.Config->AckWait) / kNanoseconds, *shards},
      *shard};
}

/// Bake and shard of a subject; none if it is somebody else's.
std::optional<std::pair<Digest, uint32_t>> ParseSubject(std::string_view subject) {
  constexpr std::string_view kBefore = "bake.", kBetween = ".task.";
  constexpr size_t kHex = 64, kShardAt = kBefore.size() + kHex + kBetween.size();
  if (subject.size() <= kShardAt || subject.substr(kBefore.size() + kHex, kBetween.size()) != kBetween)
    return std::nullopt;
  const std::optional<Digest> key = Digest::FromHex(subject.substr(kBefore.size(), kHex));
  subject.remove_prefix(kShardAt);
  const std::optional<uint32_t> shard = TakeNumber(&subject);
  return key && shard ? std::optional(std::pair(*key, *shard)) : std::nullopt;
}

// ---- Worker's side ----

class NatsLease : public TaskLease {
 public:
  NatsLease(std::shared_ptr<NatsConnection> connection, MessageHandle handle, const TaskMessage& message,
            int deliveries)
      : connection_(std::move(connection)),
        handle_(std::move(handle)),
        message_(message),
        deliveries_(deliveries) {}

  const TaskMessage& message() const override { return message_; }
  int deliveries() const override { return deliveries_; }
  // None of these can fail in a way that matters: what is not heard comes again, and its result is found.
  void Extend() override { natsMsg_InProgress(handle_.get(), nullptr); }
  void Done() override { natsMsg_AckSync(handle_.get(), nullptr, nullptr); }
  void Return(double delay_seconds) override {
    natsMsg_NakWithDelay(handle_.get(), std::lround(delay_seconds * 1000), nullptr);
  }
  void GiveUp() override { natsMsg_Term(handle_.get(), nullptr); }

 private:
  std::shared_ptr<NatsConnection> connection_;
  MessageHandle handle_;
  TaskMessage message_;
  int deliveries_;
};

int Deliveries(natsMsg* message) {
  jsMsgMetaData* made = nullptr;
  if (natsMsg_GetMetaData(&made, message) != NATS_OK) return 1;
  const NatsHandle<jsMsgMetaData, jsMsgMetaData_Destroy> meta(made);
  return static_cast<int>(std::min<uint64_t>(meta->NumDelivered, 1'000'000));
}

/// A thread's subscriptions to a bake's lines, made when they are first asked for.
class NatsSubscription : public TaskSubscription {
 public:
  NatsSubscription(std::shared_ptr<NatsConnection> connection, const Digest& bake)
      : connection_(std::move(connection)), bake_(bake) {}

  Result<std::unique_ptr<TaskLease>> Fetch(uint32_t shard, double seconds) override {
    GLINT_RETURN_IF_ERROR(Subscribe(shard));
    const auto& [line, subscription] = *Late(shard);
    natsMsgList list = {nullptr, 0};
    const natsStatus s =
        natsSubscription_Fetch(&list, subscription.get(), 1, std::lround(seconds * 1000), nullptr);
    MessageHandle handle;
    if (list.Count > 0) handle.reset(std::exchange(list.Msgs[0], nullptr));
    natsMsgList_Destroy(&list);
    if (!handle && (s == NATS_OK || s == NATS_TIMEOUT)) return std::unique_ptr<TaskLease>();
    if (!handle) return connection_->Failed("fetch a task", s);
    const std::string_view text(natsMsg_GetData(handle.get()),
                                static_cast<size_t>(natsMsg_GetDataLength(handle.get())));
    std::optional<TaskMessage> message = ParseMessage(text);
    if (!message) {  // a stranger's
      natsMsg_Term(handle.get(), nullptr);
      return std::unique_ptr<TaskLease>();
    }
    message->shard = line;
    const int deliveries = Deliveries(handle.get());
    return std::unique_ptr<TaskLease>(
        std::make_unique<NatsLease>(connection_, std::move(handle), *message, deliveries));
  }

 private:
  using Line = std::pair<const uint32_t, NatsHandle<natsSubscription, natsSubscription_Destroy>>;

  Status Subscribe(uint32_t shard) {
    if (lines_.contains(shard)) return {};
    const std::string name = ConsumerName(bake_, shard);
    jsSubOptions options;
    jsSubOptions_Init(&options);
    options.Stream = kStream;
    options.Consumer = name.c_str();
    options.ManualAck = true;
    natsSubscription* made = nullptr;
    const natsStatus s =
        js_PullSubscribe(&made, connection_->js(), Subject(bake_, std::to_string(shard)).c_str(),
                         name.c_str(), nullptr, &options, nullptr);
    if (s != NATS_OK) return connection_->Failed("subscribe to a bake's tasks", s);
    lines_[shard].reset(made);
    return {};
  }

  /// The line of `shard`, or one with a message that came when its request had run out: it counts as
  /// delivered, and would be nobody's until its lease has.
  Line* Late(uint32_t shard) {
    for (Line& line : lines_) {
      int messages = 0, bytes = 0;
      const bool pending = natsSubscription_GetPending(line.second.get(), &messages, &bytes) == NATS_OK;
      if (pending && messages > 0) return &line;
    }
    return &*lines_.find(shard);
  }

  std::shared_ptr<NatsConnection> connection_;
  const Digest bake_;
  std::map<uint32_t, NatsHandle<natsSubscription, natsSubscription_Destroy>> lines_;
};

// ---- The queue ----

class NatsQueueImpl : public NatsQueue {
 public:
  NatsQueueImpl(std::shared_ptr<NatsConnection> connection, int replicas)
      : connection_(std::move(connection)), replicas_(replicas) {}

  Status CheckReachable() override { return connection_->CheckReachable(); }

  Status Open(const QueuedBake& bake) override {
    GLINT_RETURN_IF_ERROR(AddStream());
    GLINT_RETURN_IF_ERROR(Purge(bake.bake));
    GLINT_RETURN_IF_ERROR(Visit([&](const ShardConsumer& old, const jsConsumerInfo&) {
      const bool stays = old.bake.bake != bake.bake || old.shard < bake.shards;
      return stays ? Status() : DeleteConsumer(old.bake.bake, old.shard);
    }));
    for (uint32_t shard = 0; shard < bake.shards; ++shard) GLINT_RETURN_IF_ERROR(AddConsumer(bake, shard));
    return {};
  }

  Status Publish(const Digest& bake, std::span<const TaskMessage> messages) override {
    connection_->TakeRefused();
    natsStatus s = NATS_OK;
    for (size_t i = 0; i < messages.size() && s == NATS_OK; ++i) {
      const std::string subject = Subject(bake, std::to_string(messages[i].shard));
      const std::string text = ToText(messages[i]);
      s = js_PublishAsync(js(), subject.c_str(), text.data(), static_cast<int>(text.size()), nullptr);
    }
    jsPubOptions confirm;
    jsPubOptions_Init(&confirm);
    confirm.MaxWait = kConfirmMs;
    if (s == NATS_OK) s = js_PublishAsyncComplete(js(), &confirm);
    natsMsgList unconfirmed = {nullptr, 0};
    js_PublishAsyncGetPendingList(&unconfirmed, js());  // they are the caller's to publish again
    natsMsgList_Destroy(&unconfirmed);
    if (s == NATS_OK && connection_->TakeRefused() > 0) s = NATS_ERR;
    return s == NATS_OK ? Status() : connection_->Failed("publish tasks", s);
  }

  Result<std::optional<QueueState>> State(const Digest& bake) override {
    QueueState state;
    uint32_t known = 0, shards = 0;
    GLINT_RETURN_IF_ERROR(Visit([&](const ShardConsumer& consumer, const jsConsumerInfo& info) {
      if (consumer.bake.bake != bake) return Status();
      ++known;
      shards = std::max(shards, consumer.bake.shards);
      state.waiting += info.NumPending;
      state.in_flight += static_cast<uint64_t>(info.NumAckPending);
      state.requests += static_cast<uint64_t>(info.NumWaiting);
      state.redelivered += static_cast<uint64_t>(info.NumRedelivered);
      return Status();
    }));
    if (known == 0 || known != shards) return std::optional<QueueState>();
    return std::optional(state);
  }

  Status Close(const Digest& bake) override {
    GLINT_RETURN_IF_ERROR(Visit([&](const ShardConsumer& consumer, const jsConsumerInfo&) {
      return consumer.bake.bake == bake ? DeleteConsumer(bake, consumer.shard) : Status();
    }));
    return Purge(bake);
  }

  /// From the stream's count of messages by subject: to list consumers takes the server ten times as long.
  Result<std::vector<QueuedBake>> List() override {
    GLINT_ASSIGN_OR_RETURN(const auto messages, CountMessages());
    std::vector<QueuedBake> list;
    for (const auto& [key, lines] : messages) {
      GLINT_ASSIGN_OR_RETURN(const std::optional<QueuedBake> known, About(key));
      if (!known) continue;
      list.push_back(*known);
      list.back().messages.resize(known->shards);
      for (const auto& [shard, count] : lines)
        if (shard < known->shards) list.back().messages[shard] = count;
    }
    return list;
  }

  Result<std::unique_ptr<TaskSubscription>> Subscribe(const Digest& bake) override {
    return std::unique_ptr<TaskSubscription>(std::make_unique<NatsSubscription>(connection_, bake));
  }

 private:
  jsCtx* js() const { return connection_->js(); }

  Status AddStream() {
    const char* subjects[] = {kSubjects};
    jsStreamConfig config;
    jsStreamConfig_Init(&config);
    config.Name = kStream;
    config.Subjects = subjects;
    config.SubjectsLen = 1;
    config.Retention = js_WorkQueuePolicy;
    config.Storage = js_FileStorage;
    config.Replicas = replicas_;
    config.MaxMsgSize = kMaxMessageBytes;
    config.MaxBytes = kMaxStreamBytes;
    config.Discard = js_DiscardNew;
    jsErrCode code{};
    const natsStatus s = js_AddStream(nullptr, js(), &config, nullptr, &code);
    if (s == NATS_OK || code == JSStreamNameExistErr) return {};
    return connection_->Failed("make the stream BAKE", s);
  }

  using LineCounts = std::vector<std::pair<uint32_t, uint64_t>>;  ///< shard, messages

  Result<std::map<Digest, LineCounts>> CountMessages() const {
    const std::string all = kSubjects;
    jsOptions options;
    jsOptions_Init(&options);
    options.Stream.Info.SubjectsFilter = all.c_str();
    jsStreamInfo* made = nullptr;
    jsErrCode code{};
    const natsStatus s = js_GetStreamInfo(&made, js(), kStream, &options, &code);
    const NatsHandle<jsStreamInfo, jsStreamInfo_Destroy> info(made);
    std::map<Digest, LineCounts> bakes;
    if (s == NATS_NOT_FOUND || code == JSStreamNotFoundErr) return bakes;
    if (s != NATS_OK) return connection_->Failed("list bakes", s);
    const jsStreamStateSubjects* subjects = info->State.Subjects;
    for (int i = 0; subjects && i < subjects->Count; ++i) {
      const auto line = ParseSubject(subjects->List[i].Subject);
      if (line) bakes[line->first].emplace_back(line->second, subjects->List[i].Msgs);
    }
    return bakes;
  }

  /// What a bake's first consumer says of it; none: there is no such (any more). Asked again after a while.
  Result<std::optional<QueuedBake>> About(const Digest& key) {
    constexpr std::chrono::seconds kFresh(10);
    const std::lock_guard lock(known_mutex_);
    const auto now = std::chrono::steady_clock::now();
    std::erase_if(known_, [&](const auto& entry) { return now - entry.second.second > kFresh; });
    if (const auto found = known_.find(key); found != known_.end()) return std::optional(found->second.first);
    jsConsumerInfo* made = nullptr;
    jsErrCode code{};
    const natsStatus s =
        js_GetConsumerInfo(&made, js(), kStream, ConsumerName(key, 0).c_str(), nullptr, &code);
    const ConsumerHandle info(made);
    if (s == NATS_NOT_FOUND || code == JSConsumerNotFoundErr || code == JSStreamNotFoundErr)
      return std::optional<QueuedBake>();
    if (s != NATS_OK) return connection_->Failed("ask for a bake", s);
    const std::optional<ShardConsumer> consumer = ParseConsumer(*info);
    if (!consumer) return std::optional<QueuedBake>();
    known_[key] = {consumer->bake, now};
    return std::optional(consumer->bake);
  }

  /// Calls visit(consumer, info) for every line of every bake, until it fails.
  template <class Visitor>
  Status Visit(const Visitor& visit) const {
    jsConsumerInfoList* made = nullptr;
    jsErrCode code{};
    const natsStatus s = js_Consumers(&made, js(), kStream, nullptr, &code);
    const NatsHandle<jsConsumerInfoList, jsConsumerInfoList_Destroy> list(made);
    if (s == NATS_NOT_FOUND || code == JSStreamNotFoundErr) return {};
    if (s != NATS_OK) return connection_->Failed("list bakes", s);
    for (int i = 0; i < list->Count; ++i) {
      if (const std::optional<ShardConsumer> consumer = ParseConsumer(*list->List[i]))
        GLINT_RETURN_IF_ERROR(visit(*consumer, *list->List[i]));
    }
    return {};
  }

  Status AddConsumer(const QueuedBake& bake, uint32_t shard) {
    const std::string name = ConsumerName(bake.bake, shard),
                      subject = Subject(bake.bake, std::to_string(shard)), description = Describe(bake);
    jsConsumerConfig config;
    jsConsumerConfig_Init(&config);
    config.Durable = name.c_str();
    config.Description = description.c_str();
    config.FilterSubject = subject.c_str();
    config.AckPolicy = js_AckExplicit;
    config.AckWait = static_cast<int64_t>(bake.lease_seconds * kNanoseconds);
    config.MaxDeliver = -1;
    config.MaxAckPending = kMaxInFlight;
    config.MaxWaiting = kMaxRequests;
    const natsStatus s = js_AddConsumer(nullptr, js(), kStream, &config, nullptr, nullptr);
    return s == NATS_OK ? Status() : connection_->Failed("make a bake's consumer", s);
  }

  Status DeleteConsumer(const Digest& bake, uint32_t shard) {
    jsErrCode code{};
    const natsStatus s = js_DeleteConsumer(js(), kStream, ConsumerName(bake, shard).c_str(), nullptr, &code);
    const bool gone = s == NATS_NOT_FOUND || code == JSConsumerNotFoundErr || code == JSStreamNotFoundErr;
    return s == NATS_OK || gone ? Status() : connection_->Failed("end a bake", s);
  }

  Status Purge(const Digest& bake) {
    const std::string subject = Subject(bake, "*");
    jsOptions options;
    jsOptions_Init(&options);
    options.Stream.Purge.Subject = subject.c_str();
    jsErrCode code{};
    const natsStatus s = js_PurgeStream(js(), kStream, &options, &code);
    const bool gone = s == NATS_NOT_FOUND || code == JSStreamNotFoundErr;
    return s == NATS_OK || gone ? Status() : connection_->Failed("take a bake's tasks away", s);
  }

  const std::shared_ptr<NatsConnection> connection_;
  const int replicas_;
  std::mutex known_mutex_;
  std::map<Digest, std::pair<QueuedBake, std::chrono::steady_clock::time_point>> known_;
};

}  // namespace

Result<std::unique_ptr<NatsQueue>> NatsQueue::Connect(const NatsOptions& options) {
  GLINT_ASSIGN_OR_RETURN(std::shared_ptr<NatsConnection> connection, NatsConnection::Open(options));
  return std::unique_ptr<NatsQueue>(std::make_unique<NatsQueueImpl>(std::move(connection), options.replicas));
}

}  // namespace glint
