// Runs the tests of one source file and of the headers that it includes, `--file=PATH`, or all that the program has; gtest's
// own flags work as ever.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <string_view>

namespace {

constexpr std::string_view kFlag = "--file=";

std::string ReadText(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

/// Is `place`, where a test stands, this file, or a header that the file includes?
bool IsPartOf(std::string_view place, std::string_view file, std::string_view text) {
  if (place == file) return true;
  const size_t name = place.rfind("/tests/");
  return place.substr(place.size() - 2) == ".h" && name != place.npos && text.find(place.substr(name + 1)) != text.npos;
}

/// A filter of gtest.
std::string TestsOf(std::string_view file) {
  const std::string text = ReadText(std::string(file));
  std::string filter;
  const testing::UnitTest& program = *testing::UnitTest::GetInstance();
  for (int s = 0; s < program.total_test_suite_count(); ++s) {
    const testing::TestSuite& suite = *program.GetTestSuite(s);
    for (int t = 0; t < suite.total_test_count(); ++t) {
      const testing::TestInfo& test = *suite.GetTestInfo(t);
      if (IsPartOf(test.file(), file, text)) filter += std::string(suite.name()) + '.' + test.name() + ':';
    }
  }
  return filter;
}

/// Temporary folders lie in memory where there is room: thousands of small files, each of them forced to a disk, take most of
/// the time of the tests that write them. A caller's own TMPDIR holds.
void KeepTemporaryFoldersInMemory() {
  constexpr uintmax_t kEnough = uintmax_t{4} << 30;  // bytes, for two tests at a time
  std::error_code missing;
  const std::filesystem::space_info space = std::filesystem::space("/dev/shm", missing);
  if (!missing && space.available >= kEnough) setenv("TMPDIR", "/dev/shm", 0);
}

}  // namespace

int main(int argc, char** argv) {
  KeepTemporaryFoldersInMemory();
  testing::InitGoogleTest(&argc, argv);
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument.substr(0, kFlag.size()) != kFlag) continue;
    const std::string filter = TestsOf(argument.substr(kFlag.size()));
    if (filter.empty()) {
      std::cerr << "error: no test of this program stands in " << argument.substr(kFlag.size()) << '\n';
      return 2;
    }
    testing::GTEST_FLAG(filter) = filter;
  }
  return RUN_ALL_TESTS();
}
