#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "coordinator/bake.h"
#include "coordinator/service/journal.h"

namespace glint {

/// Where a service is and who this program is to it.
struct ClientOptions {
  std::string host = "127.0.0.1:7117";       ///< HOST:PORT
  std::string ca_file, cert_file, key_file;  ///< PEM; all three or none: without, nothing is encrypted
  std::string token_file;                    ///< empty: the service asks for no token
};

/// A bake as the service tells of it.
struct RemoteBake {
  std::string id, name;
  BakeState state = BakeState::kQueued;
  Status error;  ///< kFailed
  std::string stage;
  uint64_t tasks_done = 0, tasks = 0;
  double slices_per_second = 0, seconds_left = 0;  ///< 0: not known yet
  std::vector<WorkerProgress> workers;             ///< BakeProgress::workers
  uint64_t archive_bytes = 0;
  int64_t submitted_unix = 0;
};

/// The service's calls. Errors come back as the service's own; kIo: it does not answer.
class ServiceClient {
 public:
  /// kUsage, kBadInput: the options cannot be.
  static Result<std::unique_ptr<ServiceClient>> Connect(const ClientOptions& options);
  virtual ~ServiceClient() = default;

  /// Sends a scene's bytes unless the service has them; their digest.
  virtual Result<Digest> Upload(const std::filesystem::path& scene) = 0;
  virtual Result<RemoteBake> Submit(const BakeRequest& request) = 0;
  virtual Result<std::vector<RemoteBake>> List() = 0;
  virtual Result<RemoteBake> Get(const std::string& id) = 0;
  /// Calls `on_change` with the bake now and whenever it has changed, until it has ended or StopRequested();
  /// its last state.
  virtual Result<RemoteBake> Watch(const std::string& id,
                                   const std::function<void(const RemoteBake&)>& on_change) = 0;
  virtual Result<RemoteBake> Cancel(const std::string& id) = 0;
  virtual Result<RemoteBake> Resume(const std::string& id) = 0;
  virtual Status Delete(const std::string& id) = 0;
  /// Puts a result at `path` once it has come whole. kMismatch: what came is not what was sent.
  virtual Status Fetch(const std::string& id, bool report, const std::filesystem::path& path) = 0;
};

}  // namespace glint
