#include "dataset/panoptic/exchanged.h"

#include <algorithm>
#include <map>

#include "dataset/panoptic/panoptic.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

class ExchangedFootageTest : public ::testing::TestWithParam<const char*> {
 protected:
  /// What is found where the cameras show what `shown` names.
  std::vector<ExchangedCameras> Found(const std::map<std::string, std::string>& shown) const {
    const auto image = [&](const std::string& camera, int frame) {
      const auto other = shown.find(camera);
      return data_.ImagePath(other == shown.end() ? camera : other->second, frame);
    };
    return FindExchanged(data_.rig, data_.poses, image, {});
  }
  /// In the right order, too, what moves in these two lies as much on the joints of the other.
  static bool SeeAlike(const std::string& a, const std::string& b) {
    return std::string(GetParam()) == "person_a" && std::minmax(a, b) == std::minmax<std::string>("00_01", "00_08");
  }
  PanopticDataset data_;
};

TEST_P(ExchangedFootageTest, IsFoundAndARightTakeHasNone) {
  MVS_NEEDS_DATA(GetParam());
  data_ = OpenPanopticDataset(DataFolder(GetParam()));
  EXPECT_TRUE(Found({}).empty());
  const size_t n = data_.rig.cameras.size();
  for (size_t i = 0; i < n; i += 2) {
    const std::string a = data_.rig.cameras[i].camera.name, b = data_.rig.cameras[(i + 3) % n].camera.name;
    const std::vector<ExchangedCameras> found = Found({{a, b}, {b, a}});
    if (SeeAlike(a, b)) {
      EXPECT_TRUE(found.empty());
      continue;
    }
    ASSERT_EQ(found.size(), 1u) << a << " " << b;
    EXPECT_EQ(std::min(found[0].a, found[0].b), std::min(a, b));
    EXPECT_EQ(std::max(found[0].a, found[0].b), std::max(a, b));
    EXPECT_GT(found[0].times_a * found[0].times_b, 1.25);
  }
  const std::string first = data_.rig.cameras[0].camera.name, last = data_.rig.cameras[n - 1].camera.name;
  EXPECT_TRUE(Found({{last, first}}).empty()) << "one camera's images twice are no exchange";
}

INSTANTIATE_TEST_SUITE_P(Recordings, ExchangedFootageTest, ::testing::Values("person_a", "turn_a"));

/// A block that stands still tells nothing; nor do images that are missing.
TEST(ExchangedFootage, WithoutMotionThereIsNone) {
  MVS_NEEDS_DATA("person_a");
  const PanopticDataset data = OpenPanopticDataset(DataFolder("person_a"));
  const auto still = [&](const std::string& camera, int) { return data.ImagePath(camera == "00_00" ? "00_01" : "00_00", 0); };
  EXPECT_TRUE(FindExchanged(data.rig, data.poses, still, {}).empty());
  const auto none = [](const std::string&, int) { return std::string("nowhere.jpg"); };
  EXPECT_TRUE(FindExchanged(data.rig, data.poses, none, {}).empty());
}

}  // namespace
}  // namespace mvstudio::dataset
