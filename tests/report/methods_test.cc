#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/page/image.h"
#include "report/report.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::report {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::Not;

std::string Png(const std::string& mark) { return "\x89PNG\r\n\x1a\n" + mark; }

class MethodsTest : public ::testing::Test {
 protected:
  /// A scored run with renders and truth of two frames.
  void SaveRun(const std::string& folder, const std::string& method, double ssim, const std::string& protocol) {
    const auto image = [&](int frame) {
      return Json{
          {"path", folder + "/eval/c_" + std::to_string(frame) + ".png"}, {"camera", "c"}, {"frame", frame}, {"ssim", ssim}};
    };
    const Json metrics = {{"protocol_sha256", protocol},
                          {"training", {{"options", {{"model.method", method}}}}},
                          {"holdout", {{"n", 8}, {"ssim", ssim}, {"psnr_db", 20 + ssim}, {"fd", {{"value", 9 * ssim}}}}},
                          {"baselines", {{"mean_image", {{"n", 8}, {"ssim", 0.5}}}}},
                          {"seconds_per_frame", 0.25},
                          {"pictures", {image(4), image(6)}}};
    const Json result = {
        {"schema", "mvstudio.result/1"}, {"command", "avatar eval"}, {"status", "ok"}, {"exit", 0}, {"metrics", metrics}};
    WriteFileAtomic(folder + "/avatar_eval.result.json", result.dump());
    for (const int frame : {4, 6}) {
      for (const char* kind : {"render", "truth"})
        WriteFileAtomic(folder + "/eval/" + kind + "/c_" + std::to_string(frame) + ".png",
                        Png(method + kind + std::to_string(frame)));
    }
  }
  static int Count(const std::string& html, const std::string& what) {
    int count = 0;
    for (size_t at = html.find(what); at != std::string::npos; at = html.find(what, at + 1)) ++count;
    return count;
  }

  testing::TempDir run_;
};

TEST_F(MethodsTest, OneTableAndTheSameFramesOfEach) {
  SaveRun(run_ / "a", "tna", 0.9, "p");
  SaveRun(run_ / "b", "direct", 0.8, "p");
  const Report report = BuildReport(run_.path());
  EXPECT_EQ(Count(report.html, "Methods side by side"), 1);
  EXPECT_THAT(report.html, HasSubstr("<td class=\"num\"><strong>0.9000</strong></td>"));
  EXPECT_THAT(report.html, HasSubstr("<td class=\"num\"><strong>7.200</strong></td>"))
      << "a distance is better when it is small";
  for (const char* mark : {"tnarender4", "directrender4", "tnatruth4", "tnarender6"})
    EXPECT_EQ(Count(report.html, Base64(Png(mark))), 1) << mark;
  EXPECT_EQ(Count(report.html, Base64(Png("directtruth4"))), 0) << "the truth once";
  EXPECT_THAT(report.html, HasSubstr("direct, SSIM 0.800"));
  const Json json = Json::parse(report.json);
  EXPECT_EQ(json["methods"][0][1]["name"], "direct");
  EXPECT_EQ(json["methods"][0][1]["holdout"]["ssim"], 0.8);
}

TEST_F(MethodsTest, RunsOfOneMethodAreToldApartByTheirFolders) {
  SaveRun(run_ / "seed1", "tna", 0.9, "p");
  SaveRun(run_ / "seed2", "tna", 0.8, "p");
  EXPECT_THAT(BuildReport(run_.path()).html, HasSubstr("tna (seed2), SSIM 0.800"));
}

TEST_F(MethodsTest, OtherProtocolsAreNotComparedAndOneRunIsNoComparison) {
  SaveRun(run_ / "a", "tna", 0.9, "p");
  EXPECT_THAT(BuildReport(run_.path()).html, Not(HasSubstr("Methods side by side")));
  SaveRun(run_ / "b", "direct", 0.8, "q");
  const std::string html = BuildReport(run_.path()).html;
  EXPECT_THAT(html, Not(HasSubstr("Methods side by side")));
  EXPECT_THAT(html, HasSubstr("2 runs are not in a table"));
}

TEST_F(MethodsTest, FramesThatOneRunLacksAreLeftOut) {
  SaveRun(run_ / "a", "tna", 0.9, "p");
  SaveRun(run_ / "b", "direct", 0.8, "p");
  std::filesystem::remove(run_ / "b/eval/render/c_4.png");
  const std::string html = BuildReport(run_.path()).html;
  EXPECT_EQ(Count(html, Base64(Png("tnarender4"))), 0);
  EXPECT_EQ(Count(html, Base64(Png("tnarender6"))), 1);
}

TEST_F(MethodsTest, RunsOfOtherFoldersTakePartOnce) {
  testing::TempDir other;
  SaveRun(run_ / "a", "tna", 0.9, "p");
  SaveRun(other / "b", "direct", 0.8, "p");
  ReportOptions options;
  options.with = {other.path(), other / "b", run_ / "a"};
  const Report report = BuildReport(run_.path(), options);
  EXPECT_EQ(Json::parse(report.json)["methods"][0].size(), 2u);
  EXPECT_EQ(Count(report.html, Base64(Png("directrender4"))), 1);
  options.with = {run_ / "gone"};
  EXPECT_THROW(BuildReport(run_.path(), options), IoError);
}

}  // namespace
}  // namespace mvstudio::report
