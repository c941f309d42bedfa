#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/disk/files.h"
#include "core/hash/sha256.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

using nlohmann::json;

constexpr char kBoth[] = "held-out cameras in held-out frames";
constexpr char kCameras[] = "held-out cameras in training frames";
constexpr char kMotion[] = "training cameras in held-out frames";

/// A scored run as `avatar eval` leaves it, with numbers of our choice.
struct FakeRun {
  std::string method = "tna";
  int seed = 1;
  double ssim = 0.7;
  std::vector<std::string> cameras{"00_00", "00_01", "00_02"};
  json protocol = {{"crop", {{"size_px", 96}, {"fill", 0.97}}}, {"features", {{"name", "posenet"}, {"sha256", "ab"}}}};
  std::string motion_images = "aa";
  json options = json::object();

  void Write(const std::string& folder) const {
    const auto scored = [&](double value) {
      return json{{"n", 20},
                  {"ssim", value},
                  {"psnr_db", 20.25},
                  {"mask_iou", 0.875},
                  {"fd", {{"value", 10 * value}, {"name", "FD (posenet)"}, {"features", "posenet"}}}};
    };
    const std::string canonical = protocol.dump(), sha256 = Sha256Hex(canonical.data(), canonical.size());
    json words = {{"model.method", method}, {"seed", std::to_string(seed)}, {"train.steps", "400"}};
    words.update(options);
    json metrics = {{"holdout", scored(ssim)},
                    {"baselines", {{"mean_image", scored(0.2)}, {"nearest_pose", scored(0.3)}}},
                    {"other_splits", {{kCameras, scored(ssim + 0.1)}, {kMotion, scored(ssim + 0.2)}}},
                    {"training", {{"options", words}, {"cameras", cameras}, {"size_px", 96}}},
                    {"protocol_sha256", sha256}};
    metrics["holdout"]["kind"] = kBoth;
    WriteFileAtomic(folder + "/avatar_eval.result.json", json{{"metrics", metrics}}.dump());
    WriteFileAtomic(folder + "/protocol.json",
                    json{{"schema", "mvstudio.avatar-protocol/1"},
                         {"sha256", sha256},
                         {"protocol", protocol},
                         {"splits", {{kCameras, {{"sha256", "cc"}}}, {kMotion, {{"sha256", motion_images}}}}}}
                        .dump());
  }
};

class AvatarCompare : public ::testing::Test {
 protected:
  std::string Make(const std::string& name, const FakeRun& run) const {
    run.Write(folder_ / name);
    return folder_ / name;
  }
  FakeRun Run(const std::string& method, int seed, double ssim) const {
    FakeRun run;
    run.method = method, run.seed = seed, run.ssim = ssim;
    return run;
  }
  TempDir folder_;
};

TEST_F(AvatarCompare, SeedsOfAMethodShareARowBesideTheBaselines) {
  const std::string a = Make("t1", Run("tna", 1, 0.70)), b = Make("t2", Run("tna", 2, 0.74)),
                    c = Make("d1", Run("direct", 1, 0.65));
  const std::string d = Make("d2", Run("direct", 2, 0.65));
  const CliRun run = RunCli({"avatar", "compare", a, b, c, d, "--json", "--out", folder_ / "table.md"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const json metrics = run.Json()["metrics"];
  ASSERT_EQ(metrics["rows"].size(), 4u);
  const json& tna = metrics["rows"][0];
  EXPECT_EQ(tna["name"], "TNA");
  EXPECT_EQ(tna["seeds"], json({"1", "2"}));
  EXPECT_NEAR(tna["splits"][kBoth]["ssim"]["mean"].get<double>(), 0.72, 1e-12);
  EXPECT_NEAR(tna["splits"][kBoth]["ssim"]["half_range"].get<double>(), 0.02, 1e-12);
  EXPECT_NEAR(tna["splits"][kBoth]["ssim"]["sd"].get<double>(), 0.04 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(tna["splits"][kMotion]["fd"]["mean"].get<double>(), 9.2, 1e-12);
  EXPECT_EQ(metrics["rows"][2]["name"], "mean image");
  EXPECT_EQ(metrics["rows"][3]["name"], "nearest view");
  EXPECT_NEAR(metrics["differences"][0]["ssim"].get<double>(), 0.07, 1e-12);
  EXPECT_TRUE(metrics["differences"][0]["outside_spread"].get<bool>());
  const std::string table = testing::Slurp(folder_ / "table.md");
  EXPECT_THAT(table, HasSubstr("| TNA | 2 | 0.8200 ± 0.0200 |"));
  EXPECT_THAT(table, HasSubstr("FD (posenet)"));
  EXPECT_THAT(table, Not(HasSubstr("LPIPS"))) << "absent when no run has it";
  const CliRun two = RunCli({"avatar", "compare", a, c, "--no-baselines"});
  EXPECT_THAT(two.out, Not(HasSubstr("nearest")));
  EXPECT_THAT(two.out, HasSubstr("spread is not known")) << "one seed each";
}

TEST_F(AvatarCompare, RowsThatDifferBearDifferentNames) {
  const std::string a = Make("a", Run("tna", 1, 0.7)), b = Make("b", Run("direct", 1, 0.71));
  const CliRun run = RunCli({"avatar", "compare", "x=" + a, "x=" + b});
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(run.err, HasSubstr("both called 'x'"));
}

TEST_F(AvatarCompare, ARunIsNoSampleTwice) {
  const std::string a = Make("a", Run("tna", 1, 0.7)), b = Make("b", Run("tna", 1, 0.71));
  const CliRun twice = RunCli({"avatar", "compare", a, a + "/../a/"});
  EXPECT_EQ(twice.exit, 2);
  EXPECT_THAT(twice.err, HasSubstr("given twice"));
  const CliRun same_seed = RunCli({"avatar", "compare", a, b, "--json"});
  ASSERT_EQ(same_seed.exit, 0) << same_seed.err;
  EXPECT_EQ(same_seed.Json()["warnings"][0]["code"], "CMP-SEED");
}

TEST_F(AvatarCompare, WhatTellsRowsApartIsInTheirNames) {
  FakeRun few = Run("tna", 1, 0.6), wide = Run("tna", 1, 0.75);
  few.cameras = {"00_00"}, few.motion_images = "bb";
  wide.options["model.width"] = "32";
  FakeRun narrow = Run("tna", 1, 0.7);
  narrow.options["model.width"] = "16", few.options["model.width"] = "16";
  narrow.options["train.device"] = "cuda";
  const CliRun run =
      RunCli({"avatar", "compare", Make("a", narrow), Make("b", wide), Make("c", few), "mine=" + Make("d", narrow), "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const json result = run.Json(), &rows = result["metrics"]["rows"];
  EXPECT_EQ(rows[0]["name"], "TNA, 3 cameras, width 16");
  EXPECT_EQ(rows[1]["name"], "TNA, 3 cameras, width 32");
  EXPECT_EQ(rows[2]["name"], "TNA, 1 cameras, width 16");
  EXPECT_EQ(rows[3]["name"], "mine");
  EXPECT_EQ(result["warnings"][0]["code"], "CMP-SPLIT") << "training cameras are the pictures of that split";
  EXPECT_FALSE(rows[2]["splits"][kMotion]["same_pictures"].get<bool>());
  EXPECT_TRUE(rows[2]["splits"][kCameras]["same_pictures"].get<bool>());
}

TEST_F(AvatarCompare, OtherProtocolsAreRefusedByTheFirstField) {
  FakeRun other = Run("direct", 1, 0.6);
  other.protocol["crop"]["size_px"] = 128;
  const std::string a = Make("a", Run("tna", 1, 0.7)), b = Make("b", other);
  const CliRun run = RunCli({"avatar", "compare", a, b, "--json"});
  EXPECT_EQ(run.exit, 3);
  EXPECT_THAT(run.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("crop.size_px: is 128"));
  other.protocol = FakeRun().protocol;
  other.protocol["features"] = nullptr;
  EXPECT_THAT(RunCli({"avatar", "compare", a, Make("c", other)}).err, HasSubstr("features: is not there"));
}

TEST_F(AvatarCompare, MissingEditedAndHostileFilesAreNamed) {
  const std::string a = Make("a", Run("tna", 1, 0.7)), b = Make("b", Run("tna", 2, 0.7));
  EXPECT_EQ(RunCli({"avatar", "compare", folder_ / "none"}).exit, 3);
  std::string text = ReadFile(b + "/protocol.json");
  text.replace(text.find("0.97"), 4, "0.98");
  WriteFileAtomic(b + "/protocol.json", text);
  EXPECT_THAT(RunCli({"avatar", "compare", a, b}).err, HasSubstr("does not fit the protocol"));
  std::filesystem::remove(b + "/protocol.json");
  EXPECT_THAT(RunCli({"avatar", "compare", a, b}).err, HasSubstr("avatar eval"));
  WriteFileAtomic(b + "/protocol.json", std::string(100000, '['));
  const CliRun deep = RunCli({"avatar", "compare", a, b});
  EXPECT_EQ(deep.exit, 3);
  EXPECT_EQ(std::count(deep.err.begin(), deep.err.end(), '\n'), 1);
}

/// Answers to a study of two methods, made from the page's own key.
TEST_F(AvatarCompare, SharesOfAUserStudyStandInTheirRows) {
  const std::string a = Make("tna-1", Run("tna", 1, 0.7)), b = Make("direct-1", Run("direct", 1, 0.65));
  for (const std::string& run : {a, b}) {
    std::filesystem::create_directories(run + "/eval/render");
    std::filesystem::create_directories(run + "/eval/truth");
    for (int i = 0; i < 4; ++i) {
      const std::string png = "\x89PNG\r\n\x1a\n" + run + std::to_string(i);
      WriteFileAtomic(run + "/eval/render/p" + std::to_string(i) + ".png", png);
      WriteFileAtomic(run + "/eval/truth/p" + std::to_string(i) + ".png", png);
    }
  }
  const CliRun page = RunCli({"report", "--study", a, b, "--out", folder_ / "study.html", "--json", "--study-pictures", "3"});
  ASSERT_EQ(page.exit, 0) << page.err;
  const json key = json::parse(testing::Slurp(folder_ / "study.key.json"));
  EXPECT_EQ(key["methods"], json({"tna-1", "direct-1"}));
  json answers = {
      {"schema", "mvstudio.study-answers/1"}, {"study", key["sha256"]}, {"methods", key["methods"]}, {"rater", "R"}};
  for (const json& question : key["questions"]) {
    const std::string seal = key["sha256"].get<std::string>() + "\n" + question["picture"].get<std::string>() + "\n" +
                             question["left"].get<std::string>();
    answers["answers"].push_back({{"picture", question["picture"]},
                                  {"seal", Sha256Hex(seal.data(), seal.size()).substr(0, 24)},
                                  {"choice", question["left"] == "tna-1" ? "left" : "right"}});
  }
  WriteFileAtomic(folder_ / "answers.json", answers.dump());
  const CliRun tally = RunCli({"report", "--study-tally", folder_ / "answers.json", "--json"});
  ASSERT_EQ(tally.exit, 0) << tally.err;
  EXPECT_EQ(tally.Json()["metrics"]["pooled"]["share"], 1.0);
  EXPECT_EQ(tally.Json()["metrics"]["pooled"]["p_value"], 0.25);
  const CliRun run = RunCli({"avatar", "compare", a, b, "--study", folder_ / "answers.json", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const json rows = run.Json()["metrics"]["rows"];
  EXPECT_EQ(rows[0]["study"][0]["share"], 1.0);
  EXPECT_EQ(rows[0]["study"][0]["against"], "Direct");
  EXPECT_EQ(rows[1]["study"][0]["share"], 0.0);
  EXPECT_THAT(RunCli({"avatar", "compare", a, b, "--study", folder_ / "answers.json"}).out, HasSubstr("100 % against Direct"));
}

TEST_F(AvatarCompare, StudyUsageIsChecked) {
  EXPECT_EQ(RunCli({"report"}).exit, 2);
  EXPECT_EQ(RunCli({"report", folder_.path(), "--study-tally", "x.json"}).exit, 2);
  EXPECT_EQ(RunCli({"report", "--study-tally", folder_ / "none.json"}).exit, 3);
  std::filesystem::create_directories(folder_ / "a");
  std::filesystem::create_directories(folder_ / "b");
  EXPECT_EQ(RunCli({"report", "--study", folder_ / "a", folder_ / "b"}).exit, 2) << "no --out";
  EXPECT_THAT(RunCli({"report", "--study", folder_ / "a", folder_ / "b", "--out", folder_ / "s.html"}).err,
              HasSubstr("--truth"));
}

}  // namespace
}  // namespace mvstudio
