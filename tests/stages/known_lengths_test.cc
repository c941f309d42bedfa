#include "stages/people/known_lengths.h"

#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

TEST(KnownLengths, OfPeopleByTheirHeightOfOthersAsStated) {
  const geometry::Skeleton& person = geometry::SkeletonByName("body25");
  const std::vector<calib::KnownLength> lengths = KnownLengthsOf(person, 2);
  ASSERT_EQ(lengths.size(), 8u);
  EXPECT_EQ(lengths[0].joints, std::pair(person.Find("LHip"), person.Find("LKnee")));
  EXPECT_DOUBLE_EQ(lengths[0].length_m, 0.49);

  geometry::Skeleton measured = person;  // stated lengths come before the height
  measured.lengths.assign(measured.bones.size(), {});
  measured.lengths[3] = {0.4, 0.44};
  ASSERT_EQ(KnownLengthsOf(measured, 2).size(), 1u);
  EXPECT_DOUBLE_EQ(KnownLengthsOf(measured, 2)[0].length_m, 0.42);

  geometry::Skeleton mouse = geometry::PointsSkeleton({"nose", "neck", "tail"});
  mouse.bones = {{0, 1}, {1, 2}};
  EXPECT_TRUE(KnownLengthsOf(mouse, 2).empty());
  mouse.lengths = {{0.02, 0.04}, {}};
  ASSERT_EQ(KnownLengthsOf(mouse, 2).size(), 1u);
  EXPECT_DOUBLE_EQ(KnownLengthsOf(mouse, 2)[0].length_m, 0.03);
}

}  // namespace
}  // namespace mvstudio::stages
