#include <filesystem>
#include <map>
#include <set>

#include "core/disk/files.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// `tradeoff avatar` as a program, on a grid of networks that take a second each.
namespace mvstudio {
namespace {

namespace fs = std::filesystem;

TEST(AvatarTradeoff, MeasuresAGridMarksItsFrontsAndKeepsFinishedRuns) {
  const testing::TempDir folder;
  avatar::WriteMannequinDataset(folder / "data", 4, 12, 96);
  const std::vector<std::string> words = {
      "tradeoff",
      "avatar",
      folder / "data",
      "--out",
      folder / "out",
      "--widths",
      "4",
      "--sizes",
      "32",
      "--steps",
      "0",
      "3",
      "--losses",
      "l1+ssim",
      "--cameras",
      "2",
      "3",
      "--features",
      "gabor",
      "--holdout-cameras",
      "00_03",
      "--train",
      "--downs 2 --encoder-blocks 1 --decoder-blocks 1 --no-fit-shape --validate-pictures 0"};
  std::vector<std::string> as_json = words;
  as_json.emplace_back("--json");
  const CliRun run = RunCli(as_json);
  ASSERT_EQ(run.exit, 0) << run.err;
  const nlohmann::json metrics = run.Json()["metrics"];
  EXPECT_EQ(metrics["holdout_frames"], "9-11");
  ASSERT_EQ(metrics["trials"].size(), 4u);
  std::set<int> with_front;
  for (const nlohmann::json& trial : metrics["trials"]) {
    EXPECT_TRUE(trial["ssim"].is_number()) << trial;
    EXPECT_EQ(trial["s_per_step"].is_null(), trial["steps"] == 0) << trial;
    EXPECT_GT(trial["ms_per_frame"].get<double>(), 0) << trial;
    if (trial["on_front"]) with_front.insert(trial["cameras"].get<int>());
  }
  EXPECT_EQ(with_front, (std::set<int>{2, 3})) << "fronts are of trials with as many cameras";
  const std::string page = testing::Slurp(folder / "out/tradeoff-avatar.html");
  EXPECT_THAT(page, HasSubstr("<h1>mvstudio tradeoff avatar</h1>"));
  EXPECT_THAT(page, HasSubstr("frames 9-11"));

  std::vector<fs::path> checkpoints;
  for (const auto& entry : fs::recursive_directory_iterator(std::string(folder / "out")))
    if (entry.path().filename() == "checkpoint.safetensors") checkpoints.push_back(entry.path());
  ASSERT_EQ(checkpoints.size(), 4u);
  std::vector<fs::file_time_type> written;
  for (const fs::path& path : checkpoints) written.push_back(fs::last_write_time(path));
  const CliRun again = RunCli(words);
  ASSERT_EQ(again.exit, 0) << again.err;
  EXPECT_THAT(again.out, Not(HasSubstr("nan")));
  for (size_t i = 0; i < checkpoints.size(); ++i) EXPECT_EQ(fs::last_write_time(checkpoints[i]), written[i]) << checkpoints[i];
}

TEST(AvatarTradeoff, MeasuresGaussiansBesideNetworks) {
  const testing::TempDir folder;
  avatar::WriteMannequinDataset(folder / "data", 4, 12, 96);
  const std::string body = folder / "body";
  const CliRun fit =
      RunCli({"avatar", "fit", folder / "data", "--out", body, "--holdout-cameras", "00_03", "--holdout-frames", "9-11"});
  ASSERT_TRUE(fit.exit == 0 || fit.exit == 6) << fit.err;
  const std::string small = "--downs 2 --encoder-blocks 1 --decoder-blocks 1 --validate-pictures 0 --body " + body;
  const CliRun run = RunCli({"tradeoff",
                             "avatar",
                             folder / "data",
                             "--out",
                             folder / "out",
                             "--methods",
                             "tna,gaussians",
                             "--widths",
                             "4",
                             "--gaussians",
                             "600",
                             "--sizes",
                             "32",
                             "--steps",
                             "0,3",
                             "--losses",
                             "l1+ssim",
                             "--cameras",
                             "3",
                             "--features",
                             "gabor",
                             "--train",
                             small,
                             "--json",
                             "--holdout-cameras",
                             "00_03",
                             "--holdout-frames",
                             "9-11",
                             "--train-gaussians",
                             "--colour-degree 0 --no-densify --body " + body});
  ASSERT_EQ(run.exit, 0) << run.err;
  std::map<std::string, int> methods;
  const nlohmann::json trials = run.Json()["metrics"]["trials"];
  for (const nlohmann::json& trial : trials) {
    ++methods[trial["method"]];
    EXPECT_TRUE(trial["ssim"].is_number() && trial["ms_per_frame"].is_number()) << trial;
    const bool network = trial["method"] != "gaussians" && trial["steps"] != 0;
    EXPECT_EQ(trial["num_parameters"].is_null(), trial["method"] != "gaussians" && !network) << trial;
    EXPECT_GT(trial["num_parameters"].is_null() ? 1 : trial["num_parameters"].get<double>(), 0) << trial;
    EXPECT_GT(trial["peak_rss_mb"].get<double>(), 1) << trial;
    if (trial["method"] == "gaussians") {
      EXPECT_EQ(trial["gaussians"], 600);
      EXPECT_EQ(trial["s_per_step"].is_null(), trial["steps"] == 0) << trial;
    }
  }
  EXPECT_EQ(methods, (std::map<std::string, int>{{"gaussians", 2}, {"tna", 2}}));
  EXPECT_THAT(testing::Slurp(folder / "out/tradeoff-avatar.html"), HasSubstr("600 Gaussians, 32 px, 3 steps"));
  std::vector<std::string> compare = {"avatar", "compare", "--json"};
  int with_cloud = 0;
  for (const auto& entry : fs::directory_iterator(std::string(folder / "out"))) {
    if (entry.is_directory()) compare.push_back(entry.path());
    with_cloud += fs::exists(entry.path() / "gaussians.npz");
  }
  EXPECT_EQ(with_cloud, 2);
  const CliRun compared = RunCli(compare);
  ASSERT_EQ(compared.exit, 0) << compared.err;
  int gaussians = 0, bodies = 0;
  const nlohmann::json rows = compared.Json()["metrics"]["rows"];
  for (const nlohmann::json& row : rows) {
    bodies += row["method"] == "body_alone";
    if (row["method"] != "gaussians") continue;
    ++gaussians;
    EXPECT_THAT(row["name"].get<std::string>(), HasSubstr("Gaussians, steps ")) << "the steps alone are different";
    for (const char* cost : {"frames_per_s", "train_s", "num_parameters", "train_rss_mb", "eval_rss_mb"})
      EXPECT_GT(row["costs"][cost]["mean"].get<double>(), 0) << cost;
  }
  EXPECT_EQ(gaussians, 2);
  EXPECT_EQ(bodies, 1) << "one body in all runs";
}

TEST(AvatarTradeoff, RefusesWhatCannotBeMeasured) {
  const testing::TempDir folder;
  avatar::WriteMannequinDataset(folder / "data", 4, 8, 48);
  const auto refused = [&](const std::string& flag, const std::string& value) {
    const CliRun run = RunCli({"tradeoff", "avatar", folder / "data", "--out", folder / "out", flag, value});
    EXPECT_EQ(run.exit, 2) << flag << ": " << run.err;
    return run.err;
  };
  EXPECT_THAT(refused("--losses", "l3"), HasSubstr("l3"));
  EXPECT_THAT(refused("--holdout-cameras", "00_09"), HasSubstr("00_09"));
  EXPECT_THAT(refused("--methods", "nerf"), HasSubstr("nerf"));
  const CliRun terms = RunCli(
      {"tradeoff", "avatar", folder / "data", "--out", folder / "out", "--methods", "gaussians", "--losses", "l1+gradient"});
  EXPECT_EQ(terms.exit, 2);
  EXPECT_THAT(terms.err, HasSubstr("l1 and ssim alone"));
  refused("--holdout-cameras", "00_00,00_01,00_02,00_03");
  EXPECT_FALSE(fs::exists(std::string(folder / "out")) && !fs::is_empty(std::string(folder / "out")));
}

}  // namespace
}  // namespace mvstudio
