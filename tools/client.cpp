#include "tools/client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/sha256_stream.h"
#include "coordinator/service/access.h"
#include "glint/glint.grpc.pb.h"

namespace glint {
namespace {

namespace fs = std::filesystem;

constexpr size_t kPieceBytes = size_t{1} << 20;
constexpr uint64_t kMaxResultBytes = uint64_t{1} << 40;
constexpr auto kCallTimeout = std::chrono::seconds(30);
constexpr int kMaxMessageBytes = 64 << 20;  ///< a list of a thousand bakes with long errors

std::string ToBytes(const Digest& digest) { return {digest.bytes.begin(), digest.bytes.end()}; }

/// The service's own error, if it is one.
Status FromGrpc(const std::string& host, const grpc::ClientContext& context, const grpc::Status& status) {
  if (status.ok()) return {};
  const auto& trailer = context.GetServerTrailingMetadata();
  if (const auto kind = trailer.find("glint-kind"); kind != trailer.end()) {
    int number = 0;
    std::from_chars(kind->second.begin(), kind->second.end(), number);
    if (number > 0 && number <= static_cast<int>(ErrorKind::kMismatch))
      return {static_cast<ErrorKind>(number), status.error_message()};
  }
  return IoError("the service at " + host + " does not answer as one (" + status.error_message() +
                 "); is 'glint serve' running there, and are --to and the certificates right?");
}

RemoteBake FromMessage(const v1::Bake& message) {
  RemoteBake bake;
  bake.id = message.id();
  bake.name = message.name();
  bake.state = static_cast<BakeState>(std::clamp(static_cast<int>(message.state()), 1, 5));
  const int kind = message.error_kind();
  if (kind > 0 && kind <= static_cast<int>(ErrorKind::kMismatch))
    bake.error = Status(static_cast<ErrorKind>(kind), message.error());
  bake.stage = message.stage();
  bake.tasks_done = message.tasks_done();
  bake.tasks = message.tasks();
  bake.slices_per_second = message.slices_per_second();
  bake.seconds_left = message.seconds_left();
  for (const v1::Worker& worker : message.workers())
    bake.workers.push_back({worker.name(), worker.tasks(), worker.seconds()});
  bake.archive_bytes = message.archive_bytes();
  bake.submitted_unix = message.submitted_unix();
  return bake;
}

class ClientImpl : public ServiceClient {
 public:
  ClientImpl(std::string host, std::string token, const std::shared_ptr<grpc::Channel>& channel)
      : host_(std::move(host)), token_(std::move(token)), stub_(v1::Glint::NewStub(channel)) {}

  Result<Digest> Upload(const fs::path& scene) override {
    GLINT_ASSIGN_OR_RETURN(const MappedFile file, MappedFile::Open(scene));
    const Digest digest = Sha256(file.bytes());
    v1::FindMissingRequest question;
    question.add_scenes(ToBytes(digest));
    v1::FindMissingReply missing;
    GLINT_RETURN_IF_ERROR(Call(&v1::Glint::Stub::FindMissing, question, &missing));
    if (missing.scenes_size() > 0) GLINT_RETURN_IF_ERROR(Send(digest, file.bytes()));
    return digest;
  }

  Result<RemoteBake> Submit(const BakeRequest& request) override {
    v1::SubmitRequest message;
    message.set_request(ToJson(request));
    return CallForBake(&v1::Glint::Stub::Submit, message);
  }

  Result<std::vector<RemoteBake>> List() override {
    v1::ListReply reply;
    GLINT_RETURN_IF_ERROR(Call(&v1::Glint::Stub::List, v1::ListRequest(), &reply));
    std::vector<RemoteBake> bakes;
    for (const v1::Bake& bake : reply.bakes()) bakes.push_back(FromMessage(bake));
    return bakes;
  }

  Result<RemoteBake> Get(const std::string& id) override {
    return CallForBake(&v1::Glint::Stub::Get, Named(id));
  }
  Result<RemoteBake> Cancel(const std::string& id) override {
    return CallForBake(&v1::Glint::Stub::Cancel, Named(id));
  }
  Result<RemoteBake> Resume(const std::string& id) override {
    return CallForBake(&v1::Glint::Stub::Resume, Named(id));
  }
  Status Delete(const std::string& id) override {
    v1::DeleteReply reply;
    return Call(&v1::Glint::Stub::Delete, Named(id), &reply);
  }

  Result<RemoteBake> Watch(const std::string& id,
                           const std::function<void(const RemoteBake&)>& on_change) override {
    grpc::ClientContext context;
    Introduce(&context);
    const auto reader = stub_->Watch(&context, Named(id));
    RemoteBake bake;
    v1::Bake message;
    while (!StopRequested() && reader->Read(&message)) {
      bake = FromMessage(message);
      on_change(bake);
    }
    if (StopRequested()) {
      context.TryCancel();
      reader->Finish();
      return Interrupted("no longer watching; the bake goes on, 'glint watch " + id + "' shows it again");
    }
    GLINT_RETURN_IF_ERROR(FromGrpc(host_, context, reader->Finish()));
    return bake;
  }

  Status Fetch(const std::string& id, bool report, const fs::path& path) override {
    v1::FetchRequest request;
    request.set_id(id);
    request.set_what(report ? v1::FetchRequest::REPORT : v1::FetchRequest::ARCHIVE);
    grpc::ClientContext context;
    Introduce(&context);
    const auto reader = stub_->Fetch(&context, request);
    const Result<bool> whole = Receive(reader.get(), path);
    if (!whole.ok()) context.TryCancel();
    const grpc::Status finished = reader->Finish();
    GLINT_RETURN_IF_ERROR(whole.status());
    GLINT_RETURN_IF_ERROR(FromGrpc(host_, context, finished));
    return *whole ? Status() : IoError(path.string() + ": the service ended before all had come; try again");
  }

 private:
  /// Says who this is.
  void Introduce(grpc::ClientContext* context) const {
    if (!token_.empty()) context->AddMetadata("authorization", "Bearer " + token_);
  }

  static v1::BakeRequest Named(const std::string& id) {
    v1::BakeRequest request;
    request.set_id(id);
    return request;
  }

  template <class Method, class Request, class Reply>
  Status Call(Method method, const Request& request, Reply* reply) {
    grpc::ClientContext context;
    Introduce(&context);
    context.set_deadline(std::chrono::system_clock::now() + kCallTimeout);
    return FromGrpc(host_, context, (stub_.get()->*method)(&context, request, reply));
  }
  template <class Method, class Request>
  Result<RemoteBake> CallForBake(Method method, const Request& request) {
    v1::Bake bake;
    GLINT_RETURN_IF_ERROR(Call(method, request, &bake));
    return FromMessage(bake);
  }

  Status Send(const Digest& digest, std::span<const std::byte> bytes) {
    grpc::ClientContext context;
    Introduce(&context);
    v1::UploadReply reply;
    const auto writer = stub_->Upload(&context, &reply);
    v1::UploadRequest part;
    part.mutable_header()->set_digest(ToBytes(digest));
    part.mutable_header()->set_size(bytes.size());
    bool listening = writer->Write(part);
    for (size_t at = 0; listening && at < bytes.size(); at += kPieceBytes) {
      const auto piece = bytes.subspan(at, std::min(kPieceBytes, bytes.size() - at));
      part.set_bytes(piece.data(), piece.size());
      listening = writer->Write(part);
    }
    writer->WritesDone();
    return FromGrpc(host_, context, writer->Finish());
  }

  /// False: it ended early, and nothing was written.
  template <class Reader>
  Result<bool> Receive(Reader* reader, const fs::path& path) {
    v1::FetchReply part;
    if (!reader->Read(&part) || !part.has_header()) return false;
    const v1::BlobHeader header = part.header();
    if (header.size() > kMaxResultBytes) return LimitExceeded("a result of more than 1 TiB");
    GLINT_ASSIGN_OR_RETURN(FilePublisher file, FilePublisher::Create(path));
    Sha256Stream hash;
    while (file.offset() < header.size() && reader->Read(&part)) {
      const auto piece = std::as_bytes(std::span(part.bytes()));
      hash.Update(piece);
      GLINT_RETURN_IF_ERROR(file.Write(piece));
    }
    if (file.offset() < header.size()) return false;
    if (ToBytes(hash.Finish()) != header.digest())
      return Mismatch(path.string() + ": what came is not what was sent; fetch it again");
    GLINT_RETURN_IF_ERROR(file.Commit());
    return true;
  }

  const std::string host_, token_;
  const std::unique_ptr<v1::Glint::Stub> stub_;
};

Result<std::string> ReadText(const std::string& path) {
  constexpr uint64_t kMaxPemBytes = 1 << 20;
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes, ReadFile(path, kMaxPemBytes));
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

Result<std::shared_ptr<grpc::ChannelCredentials>> MakeCredentials(const ClientOptions& options) {
  const bool any = !options.ca_file.empty() || !options.cert_file.empty() || !options.key_file.empty();
  const bool all = !options.ca_file.empty() && !options.cert_file.empty() && !options.key_file.empty();
  if (any != all)
    return UsageError("TLS needs all three: the service's authority, this client's certificate, and its key");
  if (!any) return grpc::InsecureChannelCredentials();
  grpc::SslCredentialsOptions tls;
  GLINT_ASSIGN_OR_RETURN(tls.pem_root_certs, ReadText(options.ca_file));
  GLINT_ASSIGN_OR_RETURN(tls.pem_private_key, ReadText(options.key_file));
  GLINT_ASSIGN_OR_RETURN(tls.pem_cert_chain, ReadText(options.cert_file));
  return grpc::SslCredentials(tls);
}

}  // namespace

Result<std::unique_ptr<ServiceClient>> ServiceClient::Connect(const ClientOptions& options) {
  GLINT_ASSIGN_OR_RETURN(const std::shared_ptr<grpc::ChannelCredentials> credentials,
                         MakeCredentials(options));
  std::string token;
  if (!options.token_file.empty()) {
    GLINT_ASSIGN_OR_RETURN(token, ReadToken(options.token_file));
  }
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxMessageBytes);
  // A proxy of the web is in the way of a service of one's own.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  const auto channel = grpc::CreateCustomChannel(options.host, credentials, arguments);
  return std::unique_ptr<ServiceClient>(
      std::make_unique<ClientImpl>(options.host, std::move(token), channel));
}

}  // namespace glint
