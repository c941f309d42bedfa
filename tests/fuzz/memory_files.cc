#include <map>

#include "core/disk/files.h"
#include "tests/fuzz/fuzz.h"

/// Files of the targets are held in memory: opening, writing and renaming real ones takes most of the time otherwise. The
/// linker sends all calls of ReadFile, RequireRegularFile and WriteFileAtomic here (`--wrap` in CMakeLists.txt); paths below
/// kMemory are ours, all others go on to the real functions.
namespace mvstudio::fuzz {
namespace {

constexpr std::string_view kMemory = "/mvstudio-fuzz-memory/";

std::map<std::string, std::string>& Files() {
  static std::map<std::string, std::string> files;
  return files;
}

bool IsOurs(const std::string& path) { return path.compare(0, kMemory.size(), kMemory) == 0; }

}  // namespace

std::string RealReadFile(const std::string& path) asm(
    "__real__ZN8mvstudio8ReadFileERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE");
std::string WrapReadFile(const std::string& path) asm(
    "__wrap__ZN8mvstudio8ReadFileERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE");
void RealWriteFile(const std::string& path, std::string_view content) asm(
    "__real__ZN8mvstudio15WriteFileAtomicERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEESt17basic_string_viewIcS3_E");
void WrapWriteFile(const std::string& path, std::string_view content) asm(
    "__wrap__ZN8mvstudio15WriteFileAtomicERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEESt17basic_string_viewIcS3_E");

void RealRequireRegularFile(const std::string& path) asm(
    "__real__ZN8mvstudio18RequireRegularFileERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE");
void WrapRequireRegularFile(const std::string& path) asm(
    "__wrap__ZN8mvstudio18RequireRegularFileERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE");

void WrapRequireRegularFile(const std::string& path) {
  if (!IsOurs(path)) RealRequireRegularFile(path);
}

std::string WrapReadFile(const std::string& path) {
  if (!IsOurs(path)) return RealReadFile(path);
  const auto found = Files().find(path);
  if (found == Files().end()) throw IoError(path, "cannot open: No such file or directory");
  return found->second;
}

void WrapWriteFile(const std::string& path, std::string_view content) {
  if (IsOurs(path)) {
    Files()[path] = std::string(content);
  } else {
    RealWriteFile(path, content);
  }
}

std::string MemoryPath(const std::string& name) { return std::string(kMemory) + name; }

std::string InMemory(const std::string& name, std::string_view bytes) {
  const std::string path = MemoryPath(name);
  Files()[path] = std::string(bytes);
  return path;
}

}  // namespace mvstudio::fuzz
