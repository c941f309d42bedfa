#include <cmath>
#include <set>
#include <tuple>

#include "core/error.h"
#include "stages/nets/trials/trials.h"
#include "stages/report_fields.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

const std::vector<std::string> kCameras = {"d", "b", "c", "a"};

double Cost(const AvatarTrial& t) { return double{1} * t.steps * t.width * t.size_px * t.size_px; }

TEST(AvatarTrials, EveryCombinationOnceCheapestFirst) {
  const AvatarGrid grid;  // cameras 16, 6, 3: with four cameras to choose from 4, 4 and 3
  const std::vector<AvatarTrial> trials = MakeTrials(grid, kCameras);
  const size_t with_net = 2 * 2 * 2 * 2 * 2, without = 2 * 2;  // counts, sizes, widths, steps, losses; counts, sizes
  EXPECT_EQ(trials.size(), with_net + without);
  std::set<std::tuple<size_t, int, int, int, std::string>> different;
  size_t templates = 0;
  for (size_t i = 0; i < trials.size(); ++i) {
    const AvatarTrial& t = trials[i];
    different.insert({t.cameras.size(), t.size_px, t.width, t.steps, t.loss});
    templates += t.steps == 0;
    if (i > 0) {
      EXPECT_LE(Cost(trials[i - 1]), Cost(t));
    }
    EXPECT_TRUE(std::isnan(t.ssim) && std::isnan(t.train_s) && std::isnan(t.parameters)) << "before it has run";
    EXPECT_FALSE(t.done);
    const bool three = t.cameras.size() == 3;
    EXPECT_EQ(t.cameras, three ? std::vector<std::string>({"b", "c", "d"}) : std::vector<std::string>({"a", "b", "c", "d"}));
  }
  EXPECT_EQ(different.size(), trials.size());
  EXPECT_EQ(templates, without);
}

TEST(AvatarTrials, GaussiansHaveTheirNumberInPlaceOfTheWidth) {
  AvatarGrid grid;
  grid.methods = {"tna", "gaussians"}, grid.gaussians = {0, 5000}, grid.sizes = {64}, grid.cameras = {3};
  size_t gaussians = 0, untrained = 0;
  std::set<std::string> names;
  for (const AvatarTrial& t : MakeTrials(grid, kCameras)) {
    names.insert(t.Name());
    if (t.method != "gaussians") continue;
    ++gaussians, untrained += t.steps == 0;
    EXPECT_EQ(t.width, 0);
  }
  EXPECT_EQ(gaussians, 2u * 2 * 2 + 2) << "numbers, steps, losses; and each number untrained";
  EXPECT_EQ(untrained, 2u);
  EXPECT_EQ(names.size(), MakeTrials(grid, kCameras).size());
  EXPECT_EQ(names.count("5000 Gaussians, 64 px, 300 steps, l1"), 1u);
  EXPECT_EQ(names.count("Gaussians, 64 px, not trained"), 1u);
  grid.methods = {"nerf"};
  EXPECT_THAT(MessageOf<UsageError>([&] { MakeTrials(grid, kCameras); }), HasSubstr("'nerf'"));
}

TEST(AvatarTrials, ThereMustBeACamera) {
  AvatarGrid grid;
  grid.cameras = {3, 0};
  EXPECT_THAT(MessageOf<UsageError>([&] { MakeTrials(grid, kCameras); }), HasSubstr("option 'cameras'"));
}

AvatarTrial Done(size_t cameras, double train_s, double ms_per_frame, double ssim) {
  AvatarTrial trial;
  trial.cameras.assign(cameras, "c");
  trial.train_s = train_s, trial.ms_per_frame = ms_per_frame, trial.ssim = ssim, trial.done = true;
  return trial;
}

TEST(AvatarTrials, FrontsCountWithinOneNumberOfCameras) {
  std::vector<AvatarTrial> trials = {
      Done(3, 10, 5, 0.9),          // best and quickest to train
      Done(3, 20, 1, 0.8),          // slower and worse, but quickest to render
      Done(3, 30, 9, 0.7),          // beaten in all
      Done(6, 40, 9, 0.6),          // alone with six cameras
      Done(6, 1, 1, std::nan("")),  // has no score
  };
  MarkFronts(&trials);
  std::vector<bool> train, render;
  for (const AvatarTrial& t : trials) train.push_back(t.train_front), render.push_back(t.render_front);
  EXPECT_EQ(train, std::vector<bool>({true, false, false, true, false}));
  EXPECT_EQ(render, std::vector<bool>({true, true, false, true, false}));
}

TEST(AvatarTrials, WhatHasNotRunIsNeverShownAsNaN) {
  std::vector<AvatarTrial> trials = MakeTrials({}, kCameras);
  trials[0].ssim = 0.875, trials[0].parameters = 1234, trials[0].train_s = 2, trials[0].done = true;
  MarkFronts(&trials);
  const std::string text = TrialsText(trials, "FD (gabor)");
  EXPECT_THAT(text, Not(HasSubstr("nan")));
  EXPECT_THAT(text, HasSubstr("FD (gabor)"));
  EXPECT_THAT(text, HasSubstr("0.8750"));
  EXPECT_THAT(text, HasSubstr("1234          - *"));
  const nlohmann::json table = nlohmann::json::parse(RowsJson(trials).dump());
  ASSERT_EQ(table.size(), trials.size());
  EXPECT_EQ(table[0]["ssim"], 0.875);
  EXPECT_EQ(table[0]["on_front"], true);
  EXPECT_TRUE(table[1]["ssim"].is_null() && table[1]["num_parameters"].is_null());
  EXPECT_EQ(table[1]["done"], false);
}

}  // namespace
}  // namespace mvstudio::stages
