#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

/// What the fuzz targets share. A target is a function over bytes; one program holds all of them and picks one by the name it
/// was called by (docs/fuzzing.md).
namespace mvstudio::fuzz {

using Target = void (*)(std::string_view bytes);

struct Registration {
  Registration(const char* name, Target target);
};

/// Prints what went wrong and aborts: libFuzzer keeps the input.
[[noreturn]] void Defect(const std::string& what);

/// Aborts with `what` unless `holds`.
inline void Require(bool holds, const std::string& what) {
  if (!holds) Defect(what);
}

/// True when `read` accepts its input. Hostile bytes may cause errors about files, usage and resources and nothing else: any
/// other exception, a ContractViolation among them, is a defect of the reader.
bool Accepts(const std::function<void()>& read);

/// A file that ReadFile finds, and WriteFileAtomic writes, without the file system; for readers and writers that use nothing
/// else. Same name, same path: the content is replaced.
std::string InMemory(const std::string& name, std::string_view bytes);
std::string MemoryPath(const std::string& name);

/// A real file (on /dev/shm) in a folder of this process; slower. Same name, same path: the file is replaced.
std::string Scratch(const std::string& name, std::string_view bytes);
/// An empty folder of this process, emptied again by every call.
std::string ScratchFolder(const std::string& name);
/// Path of a file that need not exist, in the folder of this process.
std::string ScratchPath(const std::string& name);

/// Formats of several files are one input with this line between the parts. Always `count` parts, the last ones empty where the
/// input has fewer.
inline constexpr std::string_view kPartSeparator = "\n--8<--\n";
std::vector<std::string_view> Parts(std::string_view bytes, size_t count);

/// Equal, or both NaN, or within `relative` of the larger one.
bool Near(double a, double b, double relative);

}  // namespace mvstudio::fuzz

/// Defines and registers a target: MVS_FUZZ_TARGET(name, bytes) { … }
#define MVS_FUZZ_TARGET(name, bytes)                                                    \
  static void Fuzz_##name(std::string_view bytes);                                      \
  static const ::mvstudio::fuzz::Registration registration_##name(#name, &Fuzz_##name); \
  static void Fuzz_##name(std::string_view bytes)
