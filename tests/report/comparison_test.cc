#include "report/compare/comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/page/image.h"
#include "tests/report/markup.h"
#include "tests/report/run_fixture.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::report {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

Json Scores(double ssim, double half, const std::string& protocol) {
  return {{"protocol_sha256", protocol},
          {"holdout", {{"n", 8}, {"ssim", ssim}, {"ssim_ci95", {ssim - half, ssim + half}}, {"psnr_db", 24.0}}},
          {"per_camera", {{{"name", "cam_07"}, {"ssim", ssim - 0.1}, {"ssim_ci95", {ssim - 0.1 - half, ssim - 0.1 + half}}}}}};
}

class ComparisonTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const std::string& run : {old_, new_}) MakeFolder(run);
  }
  static void Save(const std::string& run, const std::string& file, const Json& json) {
    WriteFileAtomic(run + "/" + file, json.dump());
  }
  void SaveScores(double before, double after, double half, const std::string& protocol_after = "p") {
    Save(old_, "avatar_eval.result.json", Result("avatar eval", Scores(before, half, "p")));
    Save(new_, "avatar_eval.result.json", Result("avatar eval", Scores(after, half, protocol_after)));
  }
  void SaveBoth(const std::string& command, const Json& before, const Json& after) {
    Save(old_, command + ".result.json", Result(command, before));
    Save(new_, command + ".result.json", Result(command, after));
  }
  Json Compare(const ReportOptions& options = {}) {
    page_ = BuildComparison({old_, new_}, options);
    return Json::parse(page_.json);
  }
  /// The entry of a figure; null without it.
  static Json FigureOf(const Json& comparison, const std::string& label, const std::string& camera = "") {
    for (const Json& figure : comparison["figures"]) {
      if (figure["figure"] == label && figure["camera"] == camera) return figure;
    }
    return {};
  }

  testing::TempDir folder_;
  const std::string old_ = folder_ / "last_week", new_ = folder_ / "today";
  Report page_;
};

TEST_F(ComparisonTest, ABetterAvatarIsSaidFirst) {
  SaveScores(0.90, 0.95, 0.01);
  const Json found = Compare();
  EXPECT_EQ(found["sentence"],
            "The avatar of today is better than that of last_week: SSIM 0.95 instead of 0.9, more than the spread.");
  EXPECT_EQ(page_.sentence, found["sentence"]);
  EXPECT_THAT(page_.html, HasSubstr("<p class=\"sentence\">The avatar of today is better than that of last_week"));
  const Json ssim = FigureOf(found, "SSIM");
  EXPECT_EQ(ssim["verdict"], "better");
  EXPECT_NEAR(ssim["change"], 0.05, 1e-12);
  EXPECT_NEAR(ssim["spread"], std::sqrt(2.0) * 0.01, 1e-12) << "of both intervals";
  EXPECT_EQ(FigureOf(found, "PSNR")["verdict"], "equal");
  EXPECT_EQ(FigureOf(found, "SSIM", "cam_07")["verdict"], "better");
  ExpectOffline(page_.html);
}

TEST_F(ComparisonTest, AWorseOneAndOneWithinTheSpreadAreSaidToo) {
  SaveScores(0.95, 0.90, 0.01);
  EXPECT_THAT(Compare()["sentence"].get<std::string>(),
              StartsWith("The avatar of today is worse than that of last_week: SSIM"));
  SaveScores(0.900, 0.910, 0.01);  // 0.010 is less than 0.0141
  const Json found = Compare();
  EXPECT_EQ(FigureOf(found, "SSIM")["verdict"], "within the spread");
  EXPECT_EQ(
      found["sentence"],
      "The avatar of today is neither better nor worse than that of last_week: SSIM 0.91 instead of 0.9, within the spread.");
}

TEST_F(ComparisonTest, ScoresOfOtherImagesAreNotCompared) {
  SaveScores(0.90, 0.95, 0.01, "q");
  Save(old_, "protocol.json", {{"protocol", {{"holdout", {{"cameras", "00_07"}}}}}});
  Save(new_, "protocol.json", {{"protocol", {{"holdout", {{"cameras", "00_03"}}}}}});
  const Json found = Compare();
  EXPECT_EQ(found["sentence"],
            "Whether the avatar of today is better than that of last_week cannot be said: other images were held out "
            "(holdout.cameras: 00_07, then 00_03).");
  for (const std::string camera : {"", "cam_07"}) {
    const Json ssim = FigureOf(found, "SSIM", camera);
    EXPECT_EQ(ssim["verdict"], "not compared");
    EXPECT_TRUE(ssim["change"].is_null());
    EXPECT_EQ(ssim["runs"][1], camera.empty() ? 0.95 : 0.95 - 0.1) << "the numbers stay";
  }
  EXPECT_THAT(page_.html, HasSubstr("Not compared, because scores of different images"));
}

TEST_F(ComparisonTest, WithoutAStatedSpreadThatIsSaid) {
  SaveBoth("calibrate", {{"rms_px", 0.3}, {"holdout_rms_px", 0.4}}, {{"rms_px", 0.30001}, {"holdout_rms_px", 0.3}});
  const Json found = Compare();
  EXPECT_EQ(found["sentence"],
            "The calibration of today is better than that of last_week: held-out rms 0.3\u00a0px instead of 0.4\u00a0px; the "
            "spread is not known.");
  EXPECT_EQ(FigureOf(found, "held-out rms")["verdict"], "better") << "less is better";
  EXPECT_TRUE(FigureOf(found, "held-out rms")["spread"].is_null());
  EXPECT_EQ(FigureOf(found, "rms")["verdict"], "equal") << "in three digits";
}

TEST_F(ComparisonTest, StandardErrorsAreTheSpreadAndCamerasHaveTheirOwn) {
  const auto metrics = [](double median, double focal) {
    return Json{{"holdout",
                 {{"median_px", median},
                  {"median_error_px", 0.1},
                  {"cameras", {{{"name", "cam_07"}, {"median_px", 2 * median}, {"median_error_px", 0.3}}}}}},
                {"cameras", {{{"name", "cam_07"}, {"focal_px", focal}, {"focal_sigma_px", 0.3}}}}};
  };
  SaveBoth("triangulate", metrics(3.0, 0), metrics(3.2, 0));
  SaveBoth("calibrate", metrics(0, 500), metrics(0, 501));
  const Json found = Compare();
  const Json median = FigureOf(found, "camera left out, median");
  EXPECT_NEAR(median["spread"], 1.959964 * std::sqrt(2.0) * 0.1, 1e-6);
  EXPECT_EQ(median["verdict"], "within the spread");
  EXPECT_EQ(FigureOf(found, "left out, median", "cam_07")["verdict"], "within the spread");
  EXPECT_EQ(FigureOf(found, "focal length", "cam_07")["verdict"], "differs") << "neither direction is better: 1 > 0.83 px";
  SaveBoth("triangulate", metrics(3.0, 0), metrics(3.5, 0));
  EXPECT_EQ(FigureOf(Compare(), "camera left out, median")["verdict"], "worse");
}

TEST_F(ComparisonTest, WhatOneRunHasAloneIsSaid) {
  Save(old_, "mask.result.json", Result("mask", {{"flicker", 0.01}}));
  Save(new_, "calibrate.result.json", Result("calibrate", {{"rms_px", 0.3}}));
  const Json found = Compare();
  EXPECT_EQ(FigureOf(found, "pixels that flicker")["verdict"], "one run only");
  EXPECT_EQ(FigureOf(found, "pixels that flicker")["runs"], Json::parse("[1, null]")) << "in per cent";
  EXPECT_EQ(FigureOf(found, "rms")["runs"], Json::parse("[null, 0.3]"));
  EXPECT_EQ(found["sentence"], "The runs have no result in common that could be compared.");
}

TEST_F(ComparisonTest, ResultsOfSeveralFoldersMeetByTheirFolders) {
  for (const auto& [take, before, after] : {std::tuple("walk", 0.8, 0.9), std::tuple("jump", 0.7, 0.6)}) {
    Save(old_, std::string(take) + "/avatar_eval.result.json", Result("avatar eval", Scores(before, 0.01, take)));
    Save(new_, std::string(take) + "/avatar_eval.result.json", Result("avatar eval", Scores(after, 0.01, take)));
  }
  const Json found = Compare();
  EXPECT_EQ(found["sentences"].size(), 2u);
  EXPECT_THAT(found["sentences"][0].get<std::string>(), StartsWith("The avatar of today in jump is worse"));
  EXPECT_THAT(found["sentences"][1].get<std::string>(), StartsWith("The avatar of today in walk is better"));
}

TEST_F(ComparisonTest, SettingsThatDifferAndOnlyThose) {
  const auto save = [&](const std::string& run, const std::string& width, const std::string& board, const std::string& out) {
    Json eval = Result("avatar eval", Scores(0.9, 0.01, "p"));
    eval["metrics"]["training"] = {{"options", {{"model.width", width}, {"model.method", "tna"}, {"train.device", width}}},
                                   {"cameras", {"a", "b"}}};
    Save(run, "avatar_eval.result.json", eval);
    Json calibrate = Result("calibrate", {{"cameras", {{{"name", "cam_07"}, {"model", board}}}}});
    calibrate["argv"] = {"mvstudio", "calibrate", "--board", board, "--out", out, "--video", "cam_07=/x/" + out, "--lens=auto"};
    Save(run, "calibrate.result.json", calibrate);
  };
  save(old_, "16", "brown5", "a"), save(new_, "32", "rational8", "b");
  const Json settings = Compare()["settings"];
  EXPECT_EQ(settings, Json::parse(R"([
      {"command": "calibrate", "what": "lens of cam_07", "runs": ["brown5", "rational8"]},
      {"command": "calibrate", "what": "option board", "runs": ["brown5", "rational8"]},
      {"command": "avatar eval", "what": "model.width", "runs": ["16", "32"]}])"));
}

TEST_F(ComparisonTest, InputsAreComparedByTheirDigests) {
  const auto save = [&](const std::string& run, const std::string& footage, const std::string& board) {
    Save(run, "calibrate.result.json", Result("calibrate", {{"rms_px", 0.3}}));
    Save(run, "sync.result.json", Result("sync", {{"reference", "a"}}));
    const auto line = [&](const char* command, const Json& inputs) {
      return Json{{"time", "2026-01-02"}, {"command", command}, {"inputs", inputs}}.dump() + "\n";
    };
    const Json video = {{"path", run + "/raw/cam_07.mp4"}, {"bytes", 12}, {"sha256", footage}};
    const Json layout = {{"path", run + "/board.toml"}, {"bytes", 3}, {"sha256_of_list", board}};
    WriteFileAtomic(run + "/provenance.jsonl", line("calibrate", {video, layout}) + line("sync", Json::array({layout})));
  };
  save(old_, "aaaaaaaa1", "bb"), save(new_, "cccccccc2", "bb");
  Json found = Compare();
  EXPECT_EQ(found["inputs"], Json::parse(R"([{"command": "calibrate", "what": "cam_07.mp4",
      "runs": ["12 bytes, aaaaaaaa", "12 bytes, cccccccc"]}])"));
  EXPECT_EQ(found["same_inputs"], Json::parse(R"(["sync"])"));
  EXPECT_THAT(found["no_inputs_in_common"], IsEmpty()) << "the board is the same";
  save(new_, "cccccccc2", "dd");
  found = Compare();
  EXPECT_EQ(found["no_inputs_in_common"], Json::parse(R"(["calibrate", "sync"])"));
  EXPECT_THAT(page_.html, HasSubstr("No input in common: calibrate, sync."));
}

class ComparedImages : public ComparisonTest {
 protected:
  static std::string Png(const std::string& mark) { return "\x89PNG\r\n\x1a\n" + mark; }
  /// Frames 4 and 6; `ssim` of each.
  static void SaveImages(const std::string& run, const std::string& mark, double ssim4, double ssim6) {
    Json result = Result("avatar eval", Scores(0.9, 0.01, "p"));
    for (const auto& [frame, ssim] : {std::pair(4, ssim4), std::pair(6, ssim6)}) {
      const std::string name = "c_" + std::to_string(frame) + ".png";
      result["metrics"]["pictures"].push_back({{"path", "eval/" + name}, {"camera", "c"}, {"frame", frame}, {"ssim", ssim}});
      WriteFileAtomic(run + "/eval/render/" + name, Png(mark + std::to_string(frame)));
      WriteFileAtomic(run + "/eval/truth/" + name, Png("truth" + std::to_string(frame)));
    }
    Save(run, "avatar_eval.result.json", result);
  }
};

TEST_F(ComparedImages, TheSameFrameOfBothHasASliderWhatLostMostFirst) {
  SaveImages(old_, "old", 0.9, 0.9), SaveImages(new_, "new", 0.95, 0.8);
  Compare();
  const std::string& html = page_.html;
  const size_t six = html.find("camera c, frame 6, SSIM -0.1"), four = html.find("camera c, frame 4, SSIM +0.05");
  EXPECT_LT(six, four);
  ASSERT_NE(four, std::string::npos);
  EXPECT_THAT(html, HasSubstr("<div class=\"beside\" data-left=\"last_week\" data-right=\"today\">"));
  for (const char* mark : {"old4", "new4", "old6", "new6", "truth4"}) EXPECT_THAT(html, HasSubstr(Base64(Png(mark)))) << mark;
  EXPECT_LT(html.find(Base64(Png("old4"))), html.find(Base64(Png("new4")))) << "the slider is between the first two images";
  EXPECT_LT(html.find(Base64(Png("new4"))), html.find(Base64(Png("truth4"))));
  EXPECT_THAT(html, HasSubstr("querySelectorAll('.beside')"));
}

/// In a browser, under the page's own policy.
TEST_F(ComparedImages, TheSliderIsPutBetweenTheRuns) {
  if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs chromium";
  SaveImages(old_, "old", 0.9, 0.9), SaveImages(new_, "new", 0.95, 0.8);
  Compare();
  WriteFileAtomic(folder_ / "page.html", page_.html);
  const std::string line = "cd " + folder_.path() +
                           " && timeout 120 chromium --headless --no-sandbox --disable-gpu --user-data-dir=" + folder_.path() +
                           "/profile --virtual-time-budget=5000 --dump-dom file://" + folder_.path() +
                           "/page.html >dom.html 2>log.txt";
  ASSERT_EQ(std::system(line.c_str()), 0);
  const std::string dom = ReadFile(folder_ / "dom.html");
  const size_t box = dom.find("<div class=\"compared\"");
  ASSERT_NE(box, std::string::npos);
  const std::string first = dom.substr(box, dom.find("<div class=\"beside\"", box) - box);
  const size_t left = first.find(Base64(Png("old6"))), right = first.find(Base64(Png("new6")));
  ASSERT_NE(right, std::string::npos);
  EXPECT_LT(left, right);
  EXPECT_THAT(first, AllOf(HasSubstr("clip-path: inset(0px 0px 0px 50%)"), HasSubstr("type=\"range\""),
                           HasSubstr("last_week left of the border, today right of it")));
}

TEST_F(ComparedImages, OtherTruthIsNoPair) {
  SaveImages(old_, "old", 0.9, 0.9), SaveImages(new_, "new", 0.95, 0.8);
  WriteFileAtomic(new_ + "/eval/truth/c_6.png", Png("another"));
  Compare();
  EXPECT_THAT(page_.html, AllOf(HasSubstr(Base64(Png("new4"))), Not(HasSubstr(Base64(Png("new6"))))));
}

TEST_F(ComparisonTest, ThreeRunsHaveAColumnEachAndTheLastIsHeldAgainstTheFirst) {
  SaveScores(0.90, 0.95, 0.01);
  const std::string between = folder_ / "between";
  Save(between, "avatar_eval.result.json", Result("avatar eval", Scores(0.99, 0.01, "p")));
  const Report page = BuildComparison({old_, between, new_});
  const Json found = Json::parse(page.json);
  EXPECT_EQ(found["runs"], Json::parse(R"(["last_week", "between", "today"])"));
  EXPECT_EQ(FigureOf(found, "SSIM")["runs"], Json::parse("[0.9, 0.99, 0.95]"));
  EXPECT_NEAR(FigureOf(found, "SSIM")["change"], 0.05, 1e-12);
  EXPECT_THAT(page.html, HasSubstr("<th scope=\"col\" class=\"num\">between</th>"));
  EXPECT_THAT(page.html, HasSubstr("aria-label=\"avatar eval: SSIM"));
  for (const std::string& figure : SvgFigures(page.html)) EXPECT_EQ(CheckMarkup(figure), "");
  Save(between, "avatar_eval.result.json", Result("avatar eval", Scores(0.99, 0.01, "q")));
  Save(new_, "avatar_eval.result.json", Result("avatar eval", Scores(0.99, 0.01, "q")));
  EXPECT_THAT(BuildComparison({old_, between, new_}).html, Not(HasSubstr("aria-label=\"avatar eval: SSIM"))) << "other images";
}

TEST_F(ComparisonTest, AClientReadsNeitherPathsNorSettings) {
  SaveScores(0.90, 0.95, 0.01);
  ReportOptions options;
  options.audience = "client";
  const Json found = Compare(options);
  EXPECT_EQ(found["sentence"],
            "The avatar of run 2 is better than that of run 1: SSIM 0.95 instead of 0.9, more than the spread.");
  for (const std::string& text : {page_.html, page_.json})
    EXPECT_THAT(text, AllOf(Not(HasSubstr(folder_.path())), Not(HasSubstr("last_week")), Not(HasSubstr("settings")),
                            Not(HasSubstr("mvstudio avatar"))));
}

TEST_F(ComparisonTest, RefusesWhatIsNoComparison) {
  SaveScores(0.90, 0.95, 0.01);
  EXPECT_THROW(BuildComparison({old_, old_ + "/../last_week"}), UsageError);
  EXPECT_THROW(BuildComparison({old_, folder_ / "gone"}), IoError);
  ReportOptions options;
  options.with = {new_};
  EXPECT_THROW(BuildComparison({old_, new_}, options), UsageError);
  options = {};
  options.audience = "boss";
  EXPECT_THROW(BuildComparison({old_, new_}, options), UsageError);
}

TEST_F(ComparisonTest, RunsOfOneNameAreToldApartByTheirFolders) {
  const std::string other = folder_ / "before/today";
  SaveScores(0.90, 0.95, 0.01);
  Save(other, "avatar_eval.result.json", Result("avatar eval", Scores(0.9, 0.01, "p")));
  const Json found = Json::parse(BuildComparison({other, new_}).json);
  EXPECT_EQ(found["runs"][0], "before/today");
  EXPECT_NE(found["runs"][1], "today");
}

}  // namespace
}  // namespace mvstudio::report
