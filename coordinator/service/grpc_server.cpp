#include "coordinator/service/grpc_server.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <utility>

#include "common/base/files.h"
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
  explicit Calls(BakeService* service) : service_(*service) {}
  /// Ends calls that would go on.
  void End() { ending_ = true; }

 private:
  using Context = grpc::ServerContext;

  grpc::Status Health(Context*, const v1::HealthRequest*, v1::HealthReply* reply) override {
    reply->set_version(GLINT_VERSION);
    reply->set_execution(ExecutionId());
    for (const BakeStatus& bake : service_.List()) {
      if (bake.entry.state == BakeState::kQueued) reply->set_queued(reply->queued() + 1);
      if (bake.entry.state == BakeState::kRunning) reply->set_running(reply->running() + 1);
    }
    return grpc::Status::OK;
  }

  grpc::Status FindMissing(Context* context, const v1::FindMissingRequest* request,
                           v1::FindMissingReply* reply) override {
    if (request->scenes_size() > kMaxScenesAsked)
      return ToGrpc(context, LimitExceeded("more than 1000 scenes in one question"));
    for (const std::string& scene : request->scenes()) {
      const std::optional<Digest> digest = ToDigest(scene);
      if (!digest) return ToGrpc(context, BadInput("a digest has 32 bytes"));
      if (!service_.HasScene(*digest)) reply->add_scenes(scene);
    }
    return grpc::Status::OK;
  }

  grpc::Status Upload(Context* context, grpc::ServerReader<v1::UploadRequest>* reader,
                      v1::UploadReply*) override {
    if (++uploads_ > kMaxUploads) {
      --uploads_;
      return ToGrpc(context, IoError("other scenes are being uploaded; try again"));
    }
    Status stored;
    const auto scene = ReceiveScene(reader, service_.max_scene_bytes());
    stored = scene.ok() ? service_.PutScene(scene->first, scene->second) : scene.status();
    --uploads_;
    return ToGrpc(context, stored);
  }

  grpc::Status Submit(Context* context, const v1::SubmitRequest* request, v1::Bake* reply) override {
    if (request->request().size() > kMaxRequestBytes)
      return ToGrpc(context, LimitExceeded("a request of more than 64 KiB"));
    const Result<BakeRequest> parsed = ParseRequest(request->request());
    return Reply(context, parsed.ok() ? service_.Submit(*parsed) : parsed.status(), reply);
  }

  grpc::Status List(Context*, const v1::ListRequest*, v1::ListReply* reply) override {
    for (const BakeStatus& bake : service_.List()) Fill(bake, reply->add_bakes());
    return grpc::Status::OK;
  }

  grpc::Status Get(Context* context, const v1::BakeRequest* request, v1::Bake* reply) override {
    return Reply(context, service_.Get(request->id()), reply);
  }
  grpc::Status Cancel(Context* context, const v1::BakeRequest* request, v1::Bake* reply) override {
    return Reply(context, service_.Cancel(request->id()), reply);
  }
  grpc::Status Resume(Context* context, const v1::BakeRequest* request, v1::Bake* reply) override {
    return Reply(context, service_.Resume(request->id()), reply);
  }
  grpc::Status Delete(Context* context, const v1::BakeRequest* request, v1::DeleteReply*) override {
    return ToGrpc(context, service_.Delete(request->id()));
  }

  grpc::Status Watch(Context* context, const v1::BakeRequest* request,
                     grpc::ServerWriter<v1::Bake>* writer) override {
    Result<BakeStatus> status = service_.Get(request->id());
    for (bool listening = true; listening && status.ok();) {
      v1::Bake message;
      Fill(*status, &message);
      listening = writer->Write(message);
      const uint64_t seen = status->version;
      if (message.state() != v1::QUEUED && message.state() != v1::RUNNING) return grpc::Status::OK;
      // Not more often than a person can follow; and to notice clients that have gone.
      do {
        status = service_.Await(request->id(), seen, kWatchPeriod);
        if (ending_)
          return ToGrpc(context, IoError("the service ends; it takes the bake up when it is started again"));
      } while (status.ok() && status->version == seen && !context->IsCancelled());
      listening = listening && !context->IsCancelled();
    }
    return ToGrpc(context, status.status());
  }

  grpc::Status Fetch(Context* context, const v1::FetchRequest* request,
                     grpc::ServerWriter<v1::FetchReply>* writer) override {
    const Result<fs::path> path =
        service_.ResultFile(request->id(), request->what() == v1::FetchRequest::REPORT);
    return ToGrpc(context, path.ok() ? SendFile(*path, writer) : path.status());
  }

  static grpc::Status Reply(Context* context, const Result<BakeStatus>& status, v1::Bake* reply) {
    if (status.ok()) Fill(*status, reply);
    return ToGrpc(context, status.status());
  }

  BakeService& service_;
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
  explicit GrpcServerImpl(BakeService* service) : calls_(service) {}
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
  auto server = std::make_unique<GrpcServerImpl>(service);
  GLINT_RETURN_IF_ERROR(server->Listen(options));
  return std::unique_ptr<GrpcServer>(std::move(server));
}

}  // namespace glint
