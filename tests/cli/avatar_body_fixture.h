#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/run_cli.h"

namespace mvstudio {

/// A dataset of five cameras and eight frames, and a body fitted to the cameras and frames that the tests train on: 00_03 and
/// the frames 6 and 7 are held out. Made once for all tests of a suite, each of which derives from its own `Suite`.
template <class Suite>
class AvatarBodyTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new testing::TempDir();
    avatar::WriteMannequinDataset(*folder_ / "data", 5, 8, 96);
    const testing::CliRun fit = testing::RunCli(
        {"avatar", "fit", data(), "--out", out("body"), "--train-cameras", "00_00,00_01,00_04", "--holdout-frames", "6-7"});
    ASSERT_TRUE(fit.exit == 0 || fit.exit == 6) << fit.err;
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string data() { return *folder_ / "data"; }
  static std::string out(const std::string& name) { return *folder_ / name; }
  /// `avatar train` on the fitted body, into out(name).
  static testing::CliRun Train(const std::string& name, const std::string& method, const std::vector<std::string>& more) {
    std::vector<std::string> words = {
        "avatar",           "train",     data(),   "--out",  out(name), "--method",          method,
        "--body",           out("body"), "--json", "--size", "48",      "--holdout-cameras", "00_03",
        "--holdout-frames", "6-7"};
    words.insert(words.end(), more.begin(), more.end());
    return testing::RunCli(words);
  }

 private:
  inline static testing::TempDir* folder_ = nullptr;
};

}  // namespace mvstudio
