#pragma once

#include <string>

namespace glint {

/// What besides scene and settings decides a result's bits: program and revision of its gathering, ray
/// tracer, instruction set, compiler with its flags that hold for every build type, C library. Machines
/// that differ in it cannot share a bake's tasks.
std::string ExecutionId();

}  // namespace glint
