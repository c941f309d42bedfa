#include "avatar/body/offset_net/offset_net.h"

#include <cmath>
#include <limits>

#include "avatar/body/files/person_file.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "core/random.h"
#include "dataset/arrays/npz.h"
#include "tests/body/swelling_take.h"
#include "tests/support/message_of.h"
#include "tests/support/one_thread.h"
#include "tests/support/test.h"

/// Offsets of a network, and their file.
namespace mvstudio::body {
namespace {

const OffsetNetSizes kSizes{2, 3, 4, 6};

NetArrays RandomArrays(const OffsetNetSizes& sizes, double scale) {
  Rng rng(5);
  NetArrays arrays;
  for (const auto& [name, shape] : OffsetNetShapes(sizes)) {
    size_t count = 1;
    for (const int64_t size : shape) count *= static_cast<size_t>(size);
    arrays[name] = {shape, std::vector<float>(count)};
    for (float& value : arrays[name].values) value = static_cast<float>(scale * rng.Normal());
  }
  arrays["spread"].values = {0.1f};
  return arrays;
}

BodyTemplate Moving(double scale) {
  BodyTemplate body = Small();
  body.moving_offsets = std::make_shared<OffsetNet>(Small(), RandomArrays(kSizes, scale));
  return body;
}

BodyPose PoseOf(int i) { return ToBodyPose(Small(), SwingingPose(i)); }

TEST(OffsetNet, HasNoOffsetsWithoutALastLayer) {
  NetArrays arrays = RandomArrays(kSizes, 1);
  for (const char* name : {"head.weight", "head.bias"}) std::fill(arrays[name].values.begin(), arrays[name].values.end(), 0.0f);
  BodyTemplate body = Small();
  body.moving_offsets = std::make_shared<OffsetNet>(Small(), arrays);
  EXPECT_EQ(SkinVertices(body, PoseOf(3)), SkinVertices(Small(), PoseOf(3)));
}

TEST(OffsetNet, StaysInItsBoundsHoweverLargeItsNumbersAre) {
  const OffsetNet net(Small(), RandomArrays(kSizes, 1e4));
  const Eigen::Matrix3Xf offsets = net.At(PosedAboutRoot(Small(), PoseOf(2)));
  ASSERT_TRUE(offsets.allFinite());
  EXPECT_LE(offsets.cwiseAbs().maxCoeff(), kOffsetNetMostM + 1e-5);
  EXPECT_GT(offsets.cwiseAbs().maxCoeff(), 0.01);
}

TEST(OffsetNet, OffsetsTurnWithThePersonAndAreThoseOfTheRestSurface) {
  const BodyTemplate body = Moving(0.5);
  ArticulatedPose pose = SwingingPose(3);
  const Eigen::Matrix3Xf offsets = body.moving_offsets->At(PosedAboutRoot(body, ToBodyPose(body, pose)));
  ASSERT_GT(offsets.cwiseAbs().maxCoeff(), 1e-3f);
  const Eigen::Quaterniond turn = geometry::RotationExp({0.3, -0.8, 1.9});
  ArticulatedPose rotated = pose;
  rotated.local_rotations[0] = turn * pose.local_rotations[0], rotated.shift = {2, -3, 0.5};
  const Eigen::Matrix3Xf same = body.moving_offsets->At(PosedAboutRoot(body, ToBodyPose(body, rotated)));
  EXPECT_LT((same - offsets).cwiseAbs().maxCoeff(), 1e-5f);
  BodyTemplate still = Small();
  still.vertices += offsets;
  EXPECT_LT((SkinVertices(body, ToBodyPose(body, pose)) - SkinVertices(still, ToBodyPose(still, pose))).cwiseAbs().maxCoeff(),
            1e-6f);
}

TEST(OffsetSmoother, SolvesItsEquation) {
  const OffsetSmoother smoother(Small(), 3);
  Eigen::Matrix3Xf one = Eigen::Matrix3Xf::Constant(3, Small().vertices.cols(), 0.02f);
  EXPECT_LT((smoother.Apply(one) - one).cwiseAbs().maxCoeff(), 1e-7f) << "what is the same everywhere stays";
  Rng rng(2);
  Eigen::Matrix3Xf a = one, b = one;
  for (float& value : a.reshaped()) value = static_cast<float>(rng.Normal());
  for (float& value : b.reshaped()) value = static_cast<float>(rng.Normal());
  const Eigen::Matrix3Xf smooth = smoother.Apply(a);
  EXPECT_LE(smooth.cwiseAbs().maxCoeff(), a.cwiseAbs().maxCoeff());
  const double ab = smooth.cwiseProduct(b).cast<double>().sum(), ba = a.cwiseProduct(smoother.Apply(b)).cast<double>().sum();
  EXPECT_NEAR(ab, ba, 1e-4 * smooth.norm() * b.norm()) << "symmetric";
}

TEST(PositionMap, IsThePlaceOfTheSurface) {
  const OffsetAtlas atlas = MakeOffsetAtlas(Small());
  ASSERT_GT(atlas.texels.size(), 2000u);
  const Eigen::Matrix3Xf map = PositionMap(atlas, Small().vertices);
  const size_t i = atlas.texels.size() / 2;
  Eigen::Vector3f x = Eigen::Vector3f::Zero();
  for (int k = 0; k < 3; ++k) x += atlas.shares(k, i) * Small().vertices.col(atlas.corners(k, i));
  EXPECT_LT((map.col(atlas.texels[i]) - x).norm(), 1e-6f);
  EXPECT_EQ((map.colwise().squaredNorm().array() > 0).count(), static_cast<Eigen::Index>(atlas.texels.size()));
}

TEST(PersonFile, ANetworkComesBackBitForBit) {
  const PersonFile person{Moving(0.5), {}};
  const std::string bytes = PersonFileBytes(person);
  const PersonFile back = ParsePersonFile(bytes, "body.npz");
  ASSERT_TRUE(back.body.moving_offsets);
  EXPECT_EQ(PersonFileBytes(back), bytes);
  EXPECT_EQ(SkinVertices(back.body, PoseOf(4)), SkinVertices(person.body, PoseOf(4)));
}

std::string RefusalOf(const std::string& name, const std::string& npy) {
  auto members = dataset::ParseNpzMembers(PersonFileBytes({Moving(0.5), {}}), "body.npz");
  members["offset_net." + name] = npy;
  std::vector<std::pair<std::string, std::string>> list;
  for (const auto& member : members) {
    if (!member.second.empty()) list.push_back(member);
  }
  return MessageOf<FormatError>([&] { ParsePersonFile(NpzOf(list), "body.npz"); });
}

TEST(PersonFile, RefusesANetworkThatIsNone) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(RefusalOf("head.bias", ""), HasSubstr("body.npz: offset_net.head.bias: is missing"));
  EXPECT_THAT(RefusalOf("head.bias", NpyOfFloats({2}, {0, 0})), HasSubstr("offset_net.head.bias: has another shape"));
  EXPECT_THAT(RefusalOf("head.bias", NpyOfFloats({3}, {0, nan, 0})), HasSubstr("offset_net.head.bias: holds a number"));
  EXPECT_THAT(RefusalOf("spread", NpyOfFloats({1}, {0})), HasSubstr("offset_net.spread: is not positive"));
  EXPECT_THAT(RefusalOf("colour", NpyOfFloats({1}, {0})), HasSubstr("offset_net.colour: is not known"));
  EXPECT_THAT(RefusalOf("stem.weight", NpyOfFloats({}, {1})), HasSubstr("offset_net.stem.weight: has another shape"));
  EXPECT_THAT(RefusalOf("stem.weight", NpyOfFloats({0, 3, 3, 3}, {})), HasSubstr("offset_net.stem.weight: has another shape"));
}

TEST(PersonFile, WritesNoNetworkOfAnotherBody) {
  BodyTemplate body = MakeMannequin(1.75, 0.3);
  body.moving_offsets = Moving(0.5).moving_offsets;
  EXPECT_THAT(MessageOf<ContractViolation>([&] { PersonFileBytes({body, {}}); }), HasSubstr("moving_offsets"));
}

}  // namespace
}  // namespace mvstudio::body
