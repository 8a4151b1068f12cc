// The traps of JetStream that this keeps clear of: de-duplication by message id would swallow what is
// published again after a loss, so messages have none; an emptied stream says nothing about results, so State
// is only ever a hint to publish again; deliveries are not limited, because the advisory that a message ran
// out of them is sent only while somebody asks for messages.
#include "common/queue/nats_queue.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <utility>

#include "common/queue/nats_connection.h"

namespace glint {
namespace {

constexpr char kStream[] = "BAKE";
constexpr char kSubjects[] = "bake.*.task";
constexpr int32_t kMaxMessageBytes = 256;                ///< ours have 65 to 84
constexpr int64_t kMaxStreamBytes = int64_t{256} << 20;  ///< a million of them
constexpr int64_t kMaxInFlight = 65'536;                 ///< of one bake, over all workers
constexpr int64_t kMaxRequests = 65'536;                 ///< of workers that wait for one bake
constexpr int64_t kConfirmMs = 10'000;
constexpr double kNanoseconds = 1e9;

using MessageHandle = NatsHandle<natsMsg, natsMsg_Destroy>;
using ConsumerHandle = NatsHandle<jsConsumerInfo, jsConsumerInfo_Destroy>;

std::string Subject(const Digest& bake) { return "bake." + bake.Hex() + ".task"; }

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

/// "<priority> <execution>"
std::string Describe(const QueuedBake& bake) {
  return std::to_string(bake.priority) + " " + Escape(bake.execution);
}

/// The bake of one of our consumers; none if it is somebody else's.
std::optional<QueuedBake> ParseConsumer(const jsConsumerInfo& info) {
  if (!info.Name || !info.Config || !info.Config->Description) return std::nullopt;
  const std::optional<Digest> key = Digest::FromHex(info.Name);
  const std::string_view description = info.Config->Description;
  const size_t space = description.find(' ');
  int priority = 0;
  const bool number =
      space != std::string_view::npos &&
      std::from_chars(description.data(), description.data() + space, priority).ec == std::errc();
  if (!key || !number) return std::nullopt;
  return QueuedBake{*key, Unescape(description.substr(space + 1)), std::clamp(priority, 1, kMaxPriority),
                    static_cast<double>(info.Config->AckWait) / kNanoseconds};
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

class NatsSubscription : public TaskSubscription {
 public:
  NatsSubscription(std::shared_ptr<NatsConnection> connection, natsSubscription* subscription)
      : connection_(std::move(connection)), subscription_(subscription) {}

  Result<std::unique_ptr<TaskLease>> Fetch(double seconds) override {
    natsMsgList list = {nullptr, 0};
    const natsStatus s =
        natsSubscription_Fetch(&list, subscription_.get(), 1, std::lround(seconds * 1000), nullptr);
    MessageHandle handle;
    if (list.Count > 0) handle.reset(std::exchange(list.Msgs[0], nullptr));
    natsMsgList_Destroy(&list);
    if (!handle && (s == NATS_OK || s == NATS_TIMEOUT)) return std::unique_ptr<TaskLease>();
    if (!handle) return connection_->Failed("fetch a task", s);
    const std::string_view text(natsMsg_GetData(handle.get()),
                                static_cast<size_t>(natsMsg_GetDataLength(handle.get())));
    const std::optional<TaskMessage> message = ParseMessage(text);
    if (!message) {  // a stranger's
      natsMsg_Term(handle.get(), nullptr);
      return std::unique_ptr<TaskLease>();
    }
    const int deliveries = Deliveries(handle.get());
    return std::unique_ptr<TaskLease>(
        std::make_unique<NatsLease>(connection_, std::move(handle), *message, deliveries));
  }

 private:
  std::shared_ptr<NatsConnection> connection_;
  NatsHandle<natsSubscription, natsSubscription_Destroy> subscription_;
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
    return AddConsumer(bake);
  }

  Status Publish(const Digest& bake, std::span<const TaskMessage> messages) override {
    connection_->TakeRefused();
    const std::string subject = Subject(bake);
    natsStatus s = NATS_OK;
    for (size_t i = 0; i < messages.size() && s == NATS_OK; ++i) {
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
    jsConsumerInfo* made = nullptr;
    jsErrCode code{};
    const natsStatus s = js_GetConsumerInfo(&made, js(), kStream, bake.Hex().c_str(), nullptr, &code);
    const ConsumerHandle info(made);
    if (s == NATS_NOT_FOUND || code == JSConsumerNotFoundErr || code == JSStreamNotFoundErr)
      return std::optional<QueueState>();
    if (s != NATS_OK) return connection_->Failed("ask for a bake's tasks", s);
    return std::optional(QueueState{info->NumPending, static_cast<uint64_t>(info->NumAckPending),
                                    static_cast<uint64_t>(info->NumWaiting),
                                    static_cast<uint64_t>(info->NumRedelivered)});
  }

  Status Close(const Digest& bake) override {
    jsErrCode code{};
    const natsStatus s = js_DeleteConsumer(js(), kStream, bake.Hex().c_str(), nullptr, &code);
    const bool gone = s == NATS_NOT_FOUND || code == JSConsumerNotFoundErr || code == JSStreamNotFoundErr;
    if (s != NATS_OK && !gone) return connection_->Failed("end a bake", s);
    return code == JSStreamNotFoundErr ? Status() : Purge(bake);
  }

  Result<std::vector<QueuedBake>> List() override {
    jsConsumerInfoList* made = nullptr;
    jsErrCode code{};
    const natsStatus s = js_Consumers(&made, js(), kStream, nullptr, &code);
    const NatsHandle<jsConsumerInfoList, jsConsumerInfoList_Destroy> list(made);
    std::vector<QueuedBake> bakes;
    if (s == NATS_NOT_FOUND || code == JSStreamNotFoundErr) return bakes;
    if (s != NATS_OK) return connection_->Failed("list bakes", s);
    for (int i = 0; i < list->Count; ++i) {
      const jsConsumerInfo& info = *list->List[i];
      if (info.NumPending == 0 && info.NumAckPending == 0) continue;
      if (std::optional<QueuedBake> bake = ParseConsumer(info)) bakes.push_back(std::move(*bake));
    }
    return bakes;
  }

  Result<std::unique_ptr<TaskSubscription>> Subscribe(const Digest& bake) override {
    const std::string name = bake.Hex();
    jsSubOptions options;
    jsSubOptions_Init(&options);
    options.Stream = kStream;
    options.Consumer = name.c_str();
    options.ManualAck = true;
    natsSubscription* made = nullptr;
    const natsStatus s =
        js_PullSubscribe(&made, js(), Subject(bake).c_str(), name.c_str(), nullptr, &options, nullptr);
    if (s != NATS_OK) return connection_->Failed("subscribe to a bake's tasks", s);
    return std::unique_ptr<TaskSubscription>(std::make_unique<NatsSubscription>(connection_, made));
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

  Status AddConsumer(const QueuedBake& bake) {
    const std::string name = bake.bake.Hex(), subject = Subject(bake.bake), description = Describe(bake);
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

  Status Purge(const Digest& bake) {
    const std::string subject = Subject(bake);
    jsOptions options;
    jsOptions_Init(&options);
    options.Stream.Purge.Subject = subject.c_str();
    const natsStatus s = js_PurgeStream(js(), kStream, &options, nullptr);
    return s == NATS_OK ? Status() : connection_->Failed("take a bake's tasks away", s);
  }

  const std::shared_ptr<NatsConnection> connection_;
  const int replicas_;
};

}  // namespace

Result<std::unique_ptr<NatsQueue>> NatsQueue::Connect(const NatsOptions& options) {
  GLINT_ASSIGN_OR_RETURN(std::shared_ptr<NatsConnection> connection, NatsConnection::Open(options));
  return std::unique_ptr<NatsQueue>(std::make_unique<NatsQueueImpl>(std::move(connection), options.replicas));
}

}  // namespace glint
