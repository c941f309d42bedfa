#include <fcntl.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <new>

#include "tests/fuzz/fuzz.h"

namespace mvstudio::fuzz {
namespace {

namespace fs = std::filesystem;

std::map<std::string, Target>& Targets() {
  static std::map<std::string, Target> targets;
  return targets;
}

Target g_target = nullptr;

/// Removed when the process ends well; scripts/fuzz removes what crashes leave.
class ProcessFolder {
 public:
  ProcessFolder() {
    const char* base = std::getenv("MVSTUDIO_FUZZ_TMP");
    std::string pattern = std::string(base ? base : "/dev/shm") + "/mvstudio-fuzz-XXXXXX";
    if (!mkdtemp(pattern.data())) Defect("cannot make a folder like " + pattern);
    path_ = pattern;
  }
  ~ProcessFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

const std::string& FolderOfProcess() {
  static const ProcessFolder folder;
  return folder.path();
}

}  // namespace

Registration::Registration(const char* name, Target target) { Targets()[name] = target; }

void Defect(const std::string& what) {
  std::fprintf(stderr, "\n==DEFECT== %s\n", what.c_str());
  std::abort();
}

bool Accepts(const std::function<void()>& read) {
  std::string why;
  try {
    read();
    return true;
  } catch (const IoError& error) {
    why = error.what();
  } catch (const FormatError& error) {
    why = error.what();
  } catch (const UsageError& error) {
    why = error.what();
  } catch (const ResourceError& error) {
    why = error.what();
  } catch (const std::exception& error) {
    Defect(std::string("an exception that callers do not expect: ") + error.what());
  }
  Require(!why.empty(), "an error without a message");
  return false;
}

std::string ScratchPath(const std::string& name) { return FolderOfProcess() + "/" + name; }

std::string Scratch(const std::string& name, std::string_view bytes) {
  const std::string path = ScratchPath(name);
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  bool written = fd >= 0;
  while (written && !bytes.empty()) {
    const ssize_t count = write(fd, bytes.data(), bytes.size());
    written = count > 0;
    if (written) bytes.remove_prefix(static_cast<size_t>(count));
  }
  if (fd >= 0) close(fd);
  Require(written, "cannot write " + path);
  return path;
}

std::string ScratchFolder(const std::string& name) {
  const std::string path = ScratchPath(name);
  fs::remove_all(path);
  fs::create_directory(path);
  return path;
}

std::vector<std::string_view> Parts(std::string_view bytes, size_t count) {
  std::vector<std::string_view> parts;
  while (parts.size() + 1 < count) {
    const size_t at = bytes.find(kPartSeparator);
    parts.push_back(bytes.substr(0, at));
    bytes = at == std::string_view::npos ? std::string_view() : bytes.substr(at + kPartSeparator.size());
  }
  parts.push_back(bytes);
  return parts;
}

bool Near(double a, double b, double relative) {
  if (std::isnan(a) || std::isnan(b)) return std::isnan(a) && std::isnan(b);
  return a == b || std::abs(a - b) <= relative * std::max(std::abs(a), std::abs(b));
}

}  // namespace mvstudio::fuzz

/// The HDF5 library loses some of what it took when it refuses a damaged file.
extern "C" const char* __lsan_default_suppressions() { return "leak:libhdf5"; }

extern "C" int LLVMFuzzerInitialize(int*, char*** argv) {
  using namespace mvstudio::fuzz;
  const std::string name = std::filesystem::path((*argv)[0]).filename().string();
  if (name == "list_targets") {
    for (const auto& [known, target] : Targets()) std::printf("%s\n", known.c_str());
    std::exit(0);
  }
  const auto found = Targets().find(name);
  if (found == Targets().end()) Defect("no target is called '" + name + "'; call this program by the name of one");
  g_target = found->second;
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  mvstudio::fuzz::g_target({reinterpret_cast<const char*>(data), size});
  return 0;
}
