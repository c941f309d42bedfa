#include "stages/pipeline/need.h"

#include "tests/support/test.h"

/// What stages are foretold to need, against peaks that `/usr/bin/time -v` measured of `mvstudio task` on synthetic studios.
namespace mvstudio::stages {
namespace {

struct MeasuredNeed {
  StageKind kind;
  FootageSize size;  // of the board's take for calibrate
  double memory_mb, disk_mb;
};

constexpr double kSmall = 0.1728, kLarge = 0.6912;  // 480x360, 960x720

const MeasuredNeed kMeasured[] = {
    {StageKind::kCalibrate, {3, kSmall, 60}, 243, 0.23},  {StageKind::kCalibrate, {3, kLarge, 60}, 294, 0.29},
    {StageKind::kCalibrate, {6, kSmall, 60}, 259, 0.47},  {StageKind::kCalibrate, {3, kSmall, 120}, 241, NAN},
    {StageKind::kSync, {3, kSmall, 20}, 195, 0.012},      {StageKind::kTriangulate, {3, kSmall, 20}, 211, 0.18},
    {StageKind::kTriangulate, {3, kLarge, 20}, 221, 0.2}, {StageKind::kMask, {3, kSmall, 20}, 609, 3.06},
    {StageKind::kMask, {3, kLarge, 20}, 839, 3.14},       {StageKind::kMask, {6, kSmall, 20}, 448, 6.25},
    {StageKind::kMask, {3, kSmall, 60}, 707, 3.95},       {StageKind::kDataset, {3, kSmall, 20}, 234, 2.41},
    {StageKind::kDataset, {3, kLarge, 20}, 314, 6.87},    {StageKind::kDataset, {6, kSmall, 20}, 234, 4.71},
    {StageKind::kDataset, {3, kSmall, 60}, 242, 7.13},    {StageKind::kVerify, {3, kLarge, 20}, 205, 0.01},
    {StageKind::kSplit, {3, kSmall, 20}, 185, 0.005},     {StageKind::kAvatar, {3, kSmall, 20}, 572, 52.1},
    {StageKind::kAvatar, {3, kLarge, 20}, 543, 51.9},     {StageKind::kAvatar, {6, kSmall, 20}, 617, 51.9},
    {StageKind::kEval, {3, kSmall, 20}, 562, NAN},        {StageKind::kReport, {3, kSmall, 20}, 202, NAN}};

TEST(Need, IsWithinAFactorOfTwoOfWhatWasMeasured) {
  for (const MeasuredNeed& run : kMeasured) {
    const StageNeed need = NeedOf(run.kind, run.size);
    const std::string which = std::string(ToString(run.kind)) + " " + std::to_string(run.size.cameras) + " cameras, " +
                              std::to_string(run.size.megapixels) + " Mpx, " + std::to_string(run.size.num_frames) + " frames";
    EXPECT_GT(need.memory_mb, run.memory_mb / 1.5) << which;
    EXPECT_LT(need.memory_mb, run.memory_mb * 1.5) << which;
    if (std::isnan(run.disk_mb)) continue;
    EXPECT_GT(need.disk_mb, run.disk_mb / 2) << which;
    EXPECT_LT(need.disk_mb, run.disk_mb * 2 + 0.01) << which;
  }
}

TEST(Need, OfMasksGrowsWithTheFramesThatAreHeldAndNoFurther) {
  const double few = NeedOf(StageKind::kMask, {8, 2, 12}).memory_mb, all = NeedOf(StageKind::kMask, {8, 2, 24}).memory_mb;
  EXPECT_NEAR(all - few, 8 * 2e6 * 12 * 3 / (1 << 20), 1e-6) << "RGB";
  EXPECT_EQ(NeedOf(StageKind::kMask, {8, 2, 2400}).memory_mb, all);
}

/// Seconds of the processor, one thread, without the program's start (docs/how-to-run-on-a-cluster.md). The rates are of
/// studios of 4 cameras; that of 8 tests them.
TEST(Need, SecondsAreThoseOfTheRates) {
  const FootageSize small{4, 0.0768, 24}, fine{4, 0.3072, 24}, other{8, 0.0768, 40};
  struct Took {
    StageKind kind;
    double small_s, fine_s, other_s;
  };
  constexpr Took kTook[] = {{StageKind::kCalibrate, 1.91, 3.47, 6.12},
                            {StageKind::kMask, 11.84, 21.36, 27.18},
                            {StageKind::kDataset, 0.43, 1.57, 1.37},
                            {StageKind::kVerify, 0.41, 2.37, 1.06},
                            {StageKind::kPack, 0.34, 0.99, 1.41}};
  double foretold_s = 0, took_s = 0;
  for (const Took& took : kTook) {
    for (const auto& [size, seconds] : {std::pair(small, took.small_s), {fine, took.fine_s}, {other, took.other_s}}) {
      const double foretold = NeedOf(took.kind, size).seconds;
      EXPECT_GT(foretold, seconds / 1.5) << ToString(took.kind) << " " << seconds;
      EXPECT_LT(foretold, seconds * 1.5) << ToString(took.kind) << " " << seconds;
    }
    foretold_s += NeedOf(took.kind, other).seconds, took_s += took.other_s;
  }
  EXPECT_NEAR(foretold_s, took_s, 0.3 * took_s);
  EXPECT_NEAR(NeedOf(StageKind::kVerify, {4, 2, 2400}).seconds - NeedOf(StageKind::kVerify, {4, 2, 1400}).seconds,
              4 * 1000 * ImageSeconds(StageKind::kVerify, 2), 1e-9);
  EXPECT_TRUE(std::isnan(NeedOf(StageKind::kAvatar, small).seconds)) << "its steps decide";
}

TEST(Need, IsNotKnownWhereNothingWasMeasured) {
  EXPECT_TRUE(std::isnan(NeedOf(StageKind::kPose2d, {3, 1, 100}).memory_mb)) << "a net of the user's";
  EXPECT_TRUE(std::isnan(NeedOf(StageKind::kExport, {3, 1, 100}).disk_mb));
}

}  // namespace
}  // namespace mvstudio::stages
