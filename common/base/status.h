#pragma once

#include <cassert>
#include <optional>
#include <string>
#include <utility>

namespace glint {

/// Kinds of failure. Each maps to one documented exit code of the command line (docs/cli.md).
enum class ErrorKind {
  kOk = 0,
  kInternal = 1,     ///< our own bug
  kUsage = 2,        ///< wrong options
  kBadInput = 3,     ///< a file or value that cannot be used
  kLimit = 4,        ///< input larger than a limit allows
  kInterrupted = 5,  ///< stopped on request; the same command resumes
  kIo = 6,           ///< the file system or the environment failed
  kMismatch = 7,     ///< verification or comparison found a difference
};

/// Success, or a kind and a message that names the file, the object and the remedy. Must be used.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(ErrorKind kind, std::string message) : kind_(kind), message_(std::move(message)) {}

  bool ok() const { return kind_ == ErrorKind::kOk; }
  ErrorKind kind() const { return kind_; }
  const std::string& message() const { return message_; }

  /// The same failure, with `context` put in front ("scene.glb: ...").
  Status WithContext(const std::string& context) const {
    return ok() ? *this : Status(kind_, context + ": " + message_);
  }

 private:
  ErrorKind kind_ = ErrorKind::kOk;
  std::string message_;
};

inline Status BadInput(std::string m) { return {ErrorKind::kBadInput, std::move(m)}; }
inline Status LimitExceeded(std::string m) { return {ErrorKind::kLimit, std::move(m)}; }
inline Status IoError(std::string m) { return {ErrorKind::kIo, std::move(m)}; }
inline Status UsageError(std::string m) { return {ErrorKind::kUsage, std::move(m)}; }
inline Status InternalError(std::string m) { return {ErrorKind::kInternal, std::move(m)}; }
inline Status Mismatch(std::string m) { return {ErrorKind::kMismatch, std::move(m)}; }
inline Status Interrupted(std::string m) { return {ErrorKind::kInterrupted, std::move(m)}; }

/// A value or the Status that says why there is none. Must be used.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : value_(std::move(value)) {}                                  // NOLINT: implicit by design
  Result(Status status) : status_(std::move(status)) { assert(!status_.ok()); }  // NOLINT: implicit by design

  bool ok() const { return value_.has_value(); }
  const Status& status() const { return status_; }
  T& value() & { return *value_; }
  const T& value() const& { return *value_; }
  T&& value() && { return std::move(*value_); }
  T& operator*() & { return *value_; }
  const T& operator*() const& { return *value_; }
  T* operator->() { return &*value_; }
  const T* operator->() const { return &*value_; }

 private:
  Status status_;
  std::optional<T> value_;
};

#define GLINT_CONCAT_INNER_(a, b) a##b
#define GLINT_CONCAT_(a, b) GLINT_CONCAT_INNER_(a, b)

/// Returns the failed Status of `expr` from the calling function.
#define GLINT_RETURN_IF_ERROR(expr)                                                        \
  do {                                                                                     \
    if (::glint::Status glint_status_ = (expr); !glint_status_.ok()) return glint_status_; \
  } while (false)

/// Declares `lhs` from the value of the Result `expr`, or returns its Status.
#define GLINT_ASSIGN_OR_RETURN(lhs, expr) \
  GLINT_ASSIGN_OR_RETURN_(GLINT_CONCAT_(glint_result_, __LINE__), lhs, expr)
#define GLINT_ASSIGN_OR_RETURN_(result, lhs, expr) \
  auto result = (expr);                            \
  if (!result.ok()) return result.status();        \
  lhs = std::move(result).value()

}  // namespace glint
