#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/click/describe.h"
#include "tests/stages/click_setup.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program: the browser is a function.
namespace mvstudio::stages {
namespace {

ClickOptions OneCamera(const TempDir& folder) {
  dataset::WriteImage(testing::DotsImage(), folder / "a.png");
  WriteFileAtomic(folder / "points.csv", "name,x,y,z\np1,0,0,0\np2,1,0,0\n");
  ClickOptions options;
  options.points = folder / "points.csv", options.out = folder / "clicks.csv";
  options.cameras = {{"a", folder / "a.png"}};
  return options;
}

constexpr char kOneClick[] = R"({"revision": 0, "clicks": [{"camera": 0, "point": 1, "x": 10.5, "y": 20}]})";

TEST(ClickStage, ClicksAreSavedAsTheyComeAndOldPagesAreAnswered) {
  const TempDir folder;
  const ClickOptions options = OneCamera(folder);
  const ClickReport report = RunClick(options, [&](const auto& answer, const auto& ended) {
    EXPECT_EQ(answer({"GET", "", ""}).status, 200);
    EXPECT_EQ(answer({"GET", "image/0.jpg", ""}).type, "image/jpeg");
    EXPECT_EQ(answer({"GET", "image/1.jpg", ""}).status, 404);
    EXPECT_EQ(answer({"POST", "clicks.json", kOneClick}).status, 200);
    EXPECT_THAT(ReadFile(options.out), HasSubstr("a,p2,10.500,20.000"));
    EXPECT_EQ(answer({"POST", "clicks.json", kOneClick}).status, 409) << "made on the revision before";
    EXPECT_FALSE(ended());
    answer({"POST", "finish", ""});
    EXPECT_TRUE(ended());
  });
  EXPECT_TRUE(report.is_written);
  EXPECT_EQ(report.scene.clicks.size(), 1u);
  EXPECT_THAT(report.notes.inputs, ElementsAre(options.cameras[0].path, options.points));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics["num_points"], 2);
  EXPECT_EQ(said.metrics["num_clicks"], 1);
  EXPECT_EQ(said.outputs.at(0).path, options.out);
  EXPECT_THAT(said.text, HasSubstr("1 of 2 points"));
}

TEST(ClickStage, WithoutAClickNothingIsWritten) {
  const TempDir folder;
  const ClickReport report = RunClick(OneCamera(folder), [](const auto&, const auto&) {});
  EXPECT_FALSE(report.is_written);
  EXPECT_TRUE(Describe(report).outputs.empty());
  EXPECT_FALSE(std::filesystem::exists(folder / "clicks.csv"));
}

TEST(ClickStage, WhatIsMissingIsAskedForBeforeThePageIsShown) {
  const TempDir folder;
  ClickOptions options = OneCamera(folder);
  const auto refused = [&] {
    return MessageOf<UsageError>([&] { RunClick(options, [](const auto&, const auto&) { FAIL() << "shown"; }); });
  };
  options.frame = 3;
  EXPECT_THAT(refused(), HasSubstr("option 'frame' 3: "));
  options.cameras.clear();
  EXPECT_THAT(refused(), HasSubstr("option 'camera' NAME=PATH is needed"));
  options.out.clear();
  EXPECT_THAT(refused(), HasSubstr("option 'out' is required"));
}

}  // namespace
}  // namespace mvstudio::stages
