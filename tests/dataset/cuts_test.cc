#include "dataset/pose/cuts.h"

#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

/// Everything known, the body centre at x metres.
Coco19Pose At(double x) {
  Coco19Pose pose;
  for (int j = 0; j < 19; ++j) {
    pose.x_in_world.col(j) << x, 0.01 * j, 1;
    pose.valid[j] = true;
  }
  return pose;
}

TEST(Cuts, ASprintIsNoneAndAJumpIsOne) {
  std::map<int, Coco19Pose> poses;
  for (int frame = 0; frame < 20; ++frame) poses[frame] = At(9.0 * frame / 29.97 + (frame >= 12 ? 1 : 0));  // 9 m/s
  EXPECT_THAT(FindCuts(poses), ElementsAre(12));
}

TEST(Cuts, LongerGapsAllowLongerWays) {
  EXPECT_TRUE(IsCut(At(0), At(1.2), 1));
  EXPECT_FALSE(IsCut(At(0), At(1.2), 10)) << "0.5 m + 3 m/s for a third of a second";
  EXPECT_THAT(FindCuts({{3, At(0)}, {13, At(1.2)}, {14, At(0)}}), ElementsAre(14));
}

TEST(Cuts, TheBodyCentreDecidesAndWithoutItTheJointsKnownInBoth) {
  Coco19Pose arm = At(0);
  arm.x_in_world.col(5).x() += 3;  // a wrist that was triangulated badly
  EXPECT_FALSE(IsCut(At(0), arm, 1));
  Coco19Pose here = At(0), there = At(2);
  here.valid[2] = false;
  EXPECT_TRUE(IsCut(here, there, 1));
  there.valid.fill(false);
  EXPECT_FALSE(IsCut(here, there, 1)) << "nothing is known";
  EXPECT_THAT(FindCuts({}), IsEmpty());
}

}  // namespace
}  // namespace mvstudio::dataset
