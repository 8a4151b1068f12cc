// Which calls a client may make, by the right of its token: all of them, as bytes on a socket.
#include "coordinator/service/grpc_server.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>

#include "glint/glint.grpc.pb.h"
#include "tests/base/temp_folder.h"

namespace glint {
namespace {

class GrpcServerTest : public testing::Test {
 protected:
  using Call = std::function<grpc::Status(grpc::ClientContext*)>;

  void SetUp() override {
    std::filesystem::create_directories(folder_ / "store");
    ServiceOptions options;
    options.store = folder_ / "store";
    options.running = 0;
    Result<std::unique_ptr<BakeService>> service = BakeService::Open(options);
    ASSERT_TRUE(service.ok()) << service.status().message();
    service_ = std::move(service).value();
    std::string lines;
    for (const Right right : {Right::kRead, Right::kSubmit, Right::kAdmin}) {
      tokens_[right] = *MakeToken();
      lines += TokenLine(RightName(right), right, tokens_[right]) + "\n";
    }
    ServerOptions server;
    server.listen = "127.0.0.1:0";
    server.tokens = *TokenList::Parse(lines);
    Result<std::unique_ptr<GrpcServer>> started = GrpcServer::Start(server, service_.get());
    ASSERT_TRUE(started.ok()) << started.status().message();
    server_ = std::move(started).value();
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
    stub_ = v1::Glint::NewStub(grpc::CreateCustomChannel("127.0.0.1:" + std::to_string(server_->port()),
                                                         grpc::InsecureChannelCredentials(), arguments));
  }

  /// A call with an empty message, which is refused, if for nothing else, for that.
  template <class Method, class Request, class Reply>
  Call Unary(Method method, Request request, Reply reply) {
    return [=, this](grpc::ClientContext* context) mutable {
      return (stub_.get()->*method)(context, request, &reply);
    };
  }
  template <class Method, class Request, class Reply>
  Call Stream(Method method, Request request, Reply reply) {
    return [=, this](grpc::ClientContext* context) mutable {
      const auto reader = (stub_.get()->*method)(context, request);
      while (reader->Read(&reply)) {
      }
      return reader->Finish();
    };
  }
  Call Upload() {
    return [this](grpc::ClientContext* context) {
      v1::UploadReply reply;
      const auto writer = stub_->Upload(context, &reply);
      writer->WritesDone();
      return writer->Finish();
    };
  }
  struct Guarded {
    std::string name;
    Right needed;
    Call call;
  };
  std::vector<Guarded> AllCalls() {
    using Stub = v1::Glint::Stub;
    const v1::BakeRequest bake;
    const v1::Bake reply;
    return {{"Health", Right::kRead, Unary(&Stub::Health, v1::HealthRequest(), v1::HealthReply())},
            {"List", Right::kRead, Unary(&Stub::List, v1::ListRequest(), v1::ListReply())},
            {"Get", Right::kRead, Unary(&Stub::Get, bake, reply)},
            {"Watch", Right::kRead, Stream(&Stub::Watch, bake, reply)},
            {"Fetch", Right::kRead, Stream(&Stub::Fetch, v1::FetchRequest(), v1::FetchReply())},
            {"FindMissing", Right::kSubmit,
             Unary(&Stub::FindMissing, v1::FindMissingRequest(), v1::FindMissingReply())},
            {"Upload", Right::kSubmit, Upload()},
            {"Submit", Right::kSubmit, Unary(&Stub::Submit, v1::SubmitRequest(), reply)},
            {"Cancel", Right::kSubmit, Unary(&Stub::Cancel, bake, reply)},
            {"Resume", Right::kSubmit, Unary(&Stub::Resume, bake, reply)},
            {"Delete", Right::kAdmin, Unary(&Stub::Delete, bake, v1::DeleteReply())}};
  }
  static grpc::StatusCode CodeWith(const Guarded& guarded, const std::string& header) {
    grpc::ClientContext context;
    if (!header.empty()) context.AddMetadata("authorization", header);
    return guarded.call(&context).error_code();
  }

  const TempFolder folder_;
  std::unique_ptr<BakeService> service_;
  std::unique_ptr<GrpcServer> server_;
  std::unique_ptr<v1::Glint::Stub> stub_;
  std::map<Right, std::string> tokens_;
};

TEST_F(GrpcServerTest, NoCallIsOpenToStrangers) {
  const std::string admin = tokens_[Right::kAdmin];
  for (const Guarded& guarded : AllCalls()) {
    for (const std::string& header :
         {std::string(), std::string("Bearer "), "Bearer " + std::string(64, '0'), admin, "Basic " + admin,
          "Bearer " + admin.substr(0, 63), "Bearer " + admin + "0"})
      EXPECT_EQ(CodeWith(guarded, header), grpc::StatusCode::UNAUTHENTICATED)
          << guarded.name << " " << header;
  }
}

TEST_F(GrpcServerTest, EveryCallNeedsItsRight) {
  const google::protobuf::ServiceDescriptor* all = v1::BakeRequest::descriptor()->file()->service(0);
  ASSERT_EQ(AllCalls().size(), static_cast<size_t>(all->method_count())) << "a call is missing here";
  for (const Guarded& guarded : AllCalls()) {
    for (const auto& [right, token] : tokens_) {
      const grpc::StatusCode code = CodeWith(guarded, "Bearer " + token);
      EXPECT_NE(code, grpc::StatusCode::UNAUTHENTICATED) << guarded.name;
      EXPECT_EQ(code == grpc::StatusCode::PERMISSION_DENIED, right < guarded.needed)
          << guarded.name << " as " << RightName(right);
    }
  }
}

}  // namespace
}  // namespace glint
