#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "dataset/footage/image_io.h"
#include "stages/scores/describe.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

/// Noise of 100 … 149, and `added`.
Image GreyNoise(int added) {
  Image image(40, 40, 3);
  Rng rng(9);
  for (uint8_t& p : image.pixels) p = static_cast<uint8_t>(100 + rng.Index(50) + added);
  return image;
}

ScoresOptions TwoFolders(const TempDir& folder) {
  for (const char* name : {"a/p1", "a/p2", "a/lone"}) dataset::WriteImage(GreyNoise(0), folder / name + ".png");
  for (const char* name : {"b/p1", "b/p2"}) dataset::WriteImage(GreyNoise(10), folder / name + ".png");
  ScoresOptions options;
  options.reference = folder / "a", options.other = folder / "b";
  return options;
}

/// Closed form: every value is 10 of 255 too large.
TEST(ScoresStage, PsnrIsThatOfTheDifference) {
  const TempDir folder;
  ScoresOptions options = TwoFolders(folder);
  options.per_image = true;
  const CommandResult said = Describe(RunPairScores(options));
  const double wanted_db = 20 * std::log10(255.0 / 10);
  EXPECT_NEAR(said.metrics["psnr_db"].get<double>(), wanted_db, 1e-6);
  ASSERT_EQ(said.metrics["pictures"].size(), 2u);
  EXPECT_NEAR(said.metrics["pictures"][1]["psnr_db"].get<double>(), wanted_db, 1e-6);
  EXPECT_FALSE(said.metrics.contains("bbox"));
  EXPECT_FALSE(said.metrics.contains("fd")) << "nobody looked for one";
  EXPECT_THAT(said.text, HasSubstr("whole images, 3200 pixels; no masks"));
  EXPECT_THAT(said.inputs, ElementsAre(options.reference, options.other));
  EXPECT_EQ(said.exit, kExitPartial);
  EXPECT_THAT(said.warnings.back().text, HasSubstr("1 images of " + options.reference + " have no partner; the first: lone"));
}

/// The mask's pixels are equal in both: their error is none, that of the whole is not.
TEST(ScoresStage, MasksAreScoredByThemselves) {
  const TempDir folder;
  ScoresOptions options = TwoFolders(folder);
  Image changed = GreyNoise(0), mask(40, 40, 1);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 40; ++x) {
      if (x < 20) {
        mask.pixels[static_cast<size_t>(40 * y + x)] = 255;
      } else {
        for (int c = 0; c < 3; ++c) changed.pixels[static_cast<size_t>(3 * (40 * y + x) + c)] += 10;
      }
    }
  }
  for (const char* name : {"p1", "p2"}) {
    dataset::WriteImage(changed, folder / "b/" + name + ".png");
    dataset::WriteImage(mask, folder / "m/" + name + ".png");
  }
  options.masks = folder / "m";
  const CommandResult said = Describe(RunPairScores(options));
  EXPECT_EQ(said.metrics["mask_pixels"], 1600);
  EXPECT_TRUE(said.metrics["masked"]["psnr_db"].is_null()) << "no error at all";
  EXPECT_NEAR(said.metrics["psnr_db"].get<double>(), 20 * std::log10(255.0 / 10) + 10 * std::log10(2), 1e-6);
  EXPECT_THAT(said.text, HasSubstr("on the masks, 1600 of 3200 pixels"));
}

TEST(ScoresStage, OneSetIsNoComparison) {
  ScoresOptions options;
  options.reference = "a";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPairScores(options); }),
              HasSubstr("give a second one, or option 'write-statistics'"));
}

TEST(ScoresStage, SetsWithoutACommonNameHaveADistanceAlone) {
  ScoresReport report;
  report.options.reference = "a", report.options.other = "b";
  report.lone_reference = "p1", report.lone_other = "q1";
  report.distance.emplace();
  report.distance->fd = 2.5, report.distance->name = "FID", report.distance->floor = report.distance->kid = NAN;
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitQualityGate);
  EXPECT_EQ(said.metrics["fd"], 2.5);
  EXPECT_TRUE(said.metrics["floor"].is_null());
  EXPECT_THAT(said.errors.at(0).text, HasSubstr("no image of b has the name of one in a (q1, p1)"));
}

}  // namespace
}  // namespace mvstudio::stages
