#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "core/error.h"
#include "tests/support/hostile_files.h"
#include "tests/support/run_cli.h"
#include "tests/support/sanitized.h"

/// Damaged files for readers that are called directly: cut at every byte, and every kind of damage. A reader may accept or
/// throw one of our errors about files; anything else, a crash included, fails. libFuzzer goes on where this ends
/// (docs/fuzzing.md) and starts from the same files. A test program includes this and names its readers with
/// INSTANTIATE_TEST_SUITE_P.
namespace mvstudio::testing {

struct HostileReader {
  std::string name;
  std::string seed;  ///< below tests/fuzz/seeds
  std::string file;  ///< name that the reader expects
  bool json = false;
  std::function<void(const std::string& path)> read;
  /// Files that hold several parts are given one of them; -1: the whole seed.
  int part = -1;
  bool numbers_may_miss = false;  ///< NaN and Infinity, as Python writes them, stand for a missing value
};

class HostileReaders : public ::testing::TestWithParam<HostileReader> {
 protected:
  static std::string SeedPath() {
    const char* source = std::getenv("MVSTUDIO_SOURCE");
    return std::string(source ? source : ".") + "/tests/fuzz/seeds/" + GetParam().seed;
  }
  static std::string Seed() {
    const std::string whole = Slurp(SeedPath()), cut = "\n--8<--\n";
    if (GetParam().part < 0) return whole;
    size_t begin = 0;
    for (int i = 0; i < GetParam().part; ++i) begin = whole.find(cut, begin) + cut.size();
    return whole.substr(begin, whole.find(cut, begin) - begin);
  }

  /// True when it is accepted. Errors about files and usage are fine, all else is a failure that names `what`.
  bool Accepts(const std::string& text, const std::string& what) {
    const std::string path = folder_ / GetParam().file;
    std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
    try {
      GetParam().read(path);
      return true;
    } catch (const FormatError&) {
    } catch (const IoError&) {
    } catch (const UsageError&) {
    } catch (const ResourceError&) {
    } catch (const std::exception& error) {
      ADD_FAILURE() << GetParam().name << ", " << what << ": " << error.what();
    }
    return false;
  }

  TempDir folder_;
};

TEST_P(HostileReaders, AcceptsItsSeed) {
  const std::string seed = Seed();
  ASSERT_FALSE(seed.empty()) << GetParam().seed;
  EXPECT_TRUE(Accepts(seed, "the seed itself"));
}

/// The other seeds of the format, among them inputs that once broke the reader.
TEST_P(HostileReaders, EverySeedOfItsFormat) {
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(SeedPath()).parent_path())) {
    Accepts(Slurp(entry.path().string()), entry.path().string());
  }
}

TEST_P(HostileReaders, CutAtEveryByte) {
  const std::string seed = Seed();
  const size_t whole = seed.find_last_not_of(" \r\n") + 1;
  for (size_t size = 0; size < whole; ++size) {
    const bool accepted = Accepts(seed.substr(0, size), "cut at byte " + std::to_string(size));
    EXPECT_FALSE(accepted && GetParam().json) << GetParam().name << " accepts what is cut at byte " << size;
  }
}

TEST_P(HostileReaders, EveryByteReplaced) {
  const std::string seed = Seed();
  for (const char byte : {'\0', '\xff', '{', '"', '9', '-', '\n'}) {
    for (size_t at = 0; at < seed.size(); at += seed.size() / 100 + 1) {
      std::string text = seed;
      text[at] = byte;
      Accepts(text, "byte " + std::to_string(at) + " replaced by " + std::to_string(byte));
    }
  }
}

TEST_P(HostileReaders, EveryKindOfDamage) {
  for (const auto& [name, text] : HostileJson(Seed())) {
    const bool accepted = Accepts(text, name);
    const bool missing = GetParam().numbers_may_miss && (name == "nan" || name == "infinity");
    EXPECT_FALSE(accepted && GetParam().json && !missing) << GetParam().name << " accepts " << name;
  }
}

/// No time that grows with the square of the number of keys, of items or of lines.
TEST_P(HostileReaders, LargeFilesInLittleTime) {
  const std::string seed = Seed();
  for (const auto& [name, text] : LargeFiles(seed, seed[0] == '{' || seed[0] == '[')) {
    const std::clock_t begin = std::clock();  // of this program: others on the machine do not matter
    Accepts(text, name);
    EXPECT_LT(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, kSanitized ? 60 : 10)
        << GetParam().name << ", " << name << ", " << text.size() << " bytes";
  }
}

TEST_P(HostileReaders, ByteOrderMark) { Accepts("\xef\xbb\xbf" + Seed(), "byte-order mark"); }

inline std::string HostileReaderName(const ::testing::TestParamInfo<HostileReader>& test) {
  std::string name = test.param.name;
  for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
}

}  // namespace mvstudio::testing
