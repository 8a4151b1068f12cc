#pragma once

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/base/status.h"

namespace glint {

/// The value; without one, prints what went wrong and ends the program.
template <class T>
T Need(Result<T> result) {
  if (result.ok()) return std::move(result).value();
  std::fprintf(stderr, "%s\n", result.status().message().c_str());
  std::exit(1);
}

/// Processor seconds of this process so far, all threads.
inline double CpuSeconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

inline std::vector<std::string> Split(const std::string& list, char separator = ',') {
  std::vector<std::string> parts;
  std::stringstream stream(list);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

/// The numbers of a list.
inline std::vector<float> Numbers(const std::string& list) {
  std::vector<float> numbers;
  for (const std::string& part : Split(list)) numbers.push_back(std::stof(part));
  return numbers;
}

/// Options of a program, with what each does with its value.
using Options = std::map<std::string, std::function<void(const std::string& value)>>;

/// Gives each option its value; returns the words that are no options. Ends the program, saying why, at an
/// option that there is not.
inline std::vector<std::string> ReadOptions(int argc, char** argv, const Options& options) {
  std::vector<std::string> words;
  for (int i = 1; i < argc; ++i) {
    const std::string key = argv[i];
    if (key.rfind("--", 0) != 0) {
      words.push_back(key);
      continue;
    }
    const auto option = options.find(key);
    if (option == options.end() || i + 1 == argc) {
      std::fprintf(stderr, "%s %s\n", option == options.end() ? "unknown option" : "no value for",
                   key.c_str());
      std::exit(2);
    }
    option->second(argv[++i]);
  }
  return words;
}

/// The same for a program that takes options alone.
inline void ReadOnlyOptions(int argc, char** argv, const Options& options) {
  for (const std::string& word : ReadOptions(argc, argv, options)) {
    std::fprintf(stderr, "unknown option %s\n", word.c_str());
    std::exit(2);
  }
}

/// What sets one number.
template <class T>
std::function<void(const std::string&)> Set(T* out) {
  return [out](const std::string& value) {
    if constexpr (std::is_floating_point_v<T>) {
      *out = static_cast<T>(std::stod(value));
    } else {
      *out = static_cast<T>(std::stoll(value));
    }
  };
}

}  // namespace glint
