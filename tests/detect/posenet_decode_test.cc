#include <cmath>

#include "core/random.h"
#include "dataset/detect/joints/posenet.h"
#include "tests/support/test.h"

/// PoseNet's maps as people with known joints would make them, and what is decoded from them.
namespace mvstudio::detect::internal {
namespace {

using dataset::Keypoint2d;
using dataset::Person2d;

constexpr int kJoints = 17, kCells = 25, kEdges = 16;
constexpr double kReachPx = 36;  // of a joint's maps about it

/// PersonLab's tree (Papandreou et al., ECCV 2018, in the order of PoseNet's displacements): parent and child of each edge.
constexpr int kParent[kEdges] = {0, 1, 0, 2, 0, 5, 7, 5, 11, 13, 0, 6, 8, 6, 12, 14};
constexpr int kChild[kEdges] = {1, 3, 2, 4, 5, 7, 9, 11, 13, 15, 6, 8, 10, 12, 14, 16};

/// A standing person about `x`, `y`, px, 17 joints of COCO.
Person2d Standing(double x, double y, double scale = 1, double score = 0.9) {
  constexpr double kBody[kJoints][2] = {{0, -80},   {5, -86},  {-5, -86},  {12, -82}, {-12, -82}, {24, -56},
                                        {-24, -56}, {32, -22}, {-32, -22}, {35, 8},   {-35, 8},   {15, 5},
                                        {-15, 5},   {18, 50},  {-18, 50},  {20, 95},  {-20, 95}};
  Person2d person;
  for (const auto& at : kBody) person.keypoints.push_back({x + scale * at[0], y + scale * at[1], score});
  return person;
}

PosenetOutputs Empty() {
  const auto zeros = [](int channels) {
    return FloatTensor{{1, kCells, kCells, channels}, std::vector<float>(static_cast<size_t>(kCells * kCells * channels), 0)};
  };
  return {zeros(kJoints), zeros(2 * kJoints), zeros(2 * kEdges), zeros(2 * kEdges)};
}

/// Writes (dx, dy) of `index` of `count` pairs at a cell; y comes first.
void SetPair(FloatTensor* tensor, size_t cell, int count, int index, double dx, double dy) {
  tensor->values[cell * 2 * count + index] = static_cast<float>(dy);
  tensor->values[cell * 2 * count + count + index] = static_cast<float>(dx);
}

/// Each joint fills the maps of its cells: score falling off, offset to the joint, displacements to its neighbours in the tree
/// with an error of up to `error_px`.
void Add(const Person2d& person, double error_px, Rng* rng, PosenetOutputs* out) {
  for (int j = 0; j < kJoints; ++j) {
    const Keypoint2d& joint = person.keypoints[static_cast<size_t>(j)];
    for (int v = 0; v < kCells; ++v) {
      for (int u = 0; u < kCells; ++u) {
        const double dx = joint.x_px - u * kPosenetStride, dy = joint.y_px - v * kPosenetStride, r = std::hypot(dx, dy);
        if (r > kReachPx) continue;
        const auto cell = static_cast<size_t>(v * kCells + u);
        float& score = out->heat.values[cell * kJoints + static_cast<size_t>(j)];
        const double value = joint.score * std::exp(-r * r / 2000);
        if (value < score) continue;  // another person's joint is nearer
        score = static_cast<float>(value);
        SetPair(&out->offset, cell, kJoints, j, dx, dy);
        const auto lead = [&](FloatTensor* tensor, int edge, int to) {
          const Keypoint2d& other = person.keypoints[static_cast<size_t>(to)];
          SetPair(tensor, cell, kEdges, edge, other.x_px - joint.x_px + rng->Uniform(-error_px, error_px),
                  other.y_px - joint.y_px + rng->Uniform(-error_px, error_px));
        };
        for (int e = 0; e < kEdges; ++e) {
          if (kParent[e] == j) lead(&out->forward, e, kChild[e]);
          if (kChild[e] == j) lead(&out->backward, e, kParent[e]);
        }
      }
    }
  }
}

double LargestDistance(const Person2d& a, const Person2d& b) {
  double largest = 0;
  for (size_t j = 0; j < kJoints; ++j)
    largest =
        std::max(largest, std::hypot(a.keypoints[j].x_px - b.keypoints[j].x_px, a.keypoints[j].y_px - b.keypoints[j].y_px));
  return largest;
}

/// The offsets at the end of a displacement correct it, so an error of half a cell does no harm.
TEST(DecodePeople, FollowsTheTreeFromTheBestJoint) {
  Rng rng(1);
  for (const double error_px : {0.0, 8.0}) {
    for (const int best : {0, 9, 16}) {  // the root, a leaf of each half
      Person2d person = Standing(190.3, 180.8);
      person.keypoints[static_cast<size_t>(best)].score = 0.99;
      PosenetOutputs out = Empty();
      Add(person, error_px, &rng, &out);
      const std::vector<CoarsePerson> found = DecodePeople(out);
      ASSERT_EQ(found.size(), 1u) << "each joint starts a person only where none was found";
      EXPECT_LT(LargestDistance(found[0].pose, person), 1e-3) << best;
      EXPECT_GT(found[0].score, 0.8);
      EXPECT_LT(found[0].score, 0.92);
    }
  }
}

TEST(DecodePeople, TwoPeopleAreToldApartAndComeByScore) {
  Rng rng(2);
  const Person2d left = Standing(100.2, 200.7, 1, 0.7), right = Standing(290.6, 190.4, 1.1, 0.95);
  PosenetOutputs out = Empty();
  Add(left, 2, &rng, &out), Add(right, 2, &rng, &out);
  const std::vector<CoarsePerson> found = DecodePeople(out);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_LT(LargestDistance(found[0].pose, right), 1e-3);
  EXPECT_LT(LargestDistance(found[1].pose, left), 1e-3);
}

TEST(DecodePeople, FaintJointsAreNobody) {
  Rng rng(3);
  PosenetOutputs faint = Empty(), hand = Empty();
  Add(Standing(190, 180, 1, 0.3), 0, &rng, &faint);
  EXPECT_TRUE(DecodePeople(faint).empty()) << "no joint is sure enough to start from";
  Person2d person = Standing(190, 180, 1, 0.05);
  person.keypoints[9].score = 0.95;
  Add(person, 0, &rng, &hand);
  EXPECT_TRUE(DecodePeople(hand).empty()) << "one hand is no person";
  EXPECT_TRUE(DecodePeople(Empty()).empty());
}

/// Joints at the border lead out of the image: the last cell's offset is taken.
TEST(DecodePeople, APersonCutOffByTheBorderKeepsTheJointsInside) {
  Rng rng(4);
  const Person2d person = Standing(190.2, 330.5);  // knees and feet below the image, 384 px
  PosenetOutputs out = Empty();
  Add(person, 0, &rng, &out);
  const std::vector<CoarsePerson> found = DecodePeople(out);
  ASSERT_EQ(found.size(), 1u);
  for (size_t j = 0; j < 13; ++j) {
    EXPECT_NEAR(found[0].pose.keypoints[j].x_px, person.keypoints[j].x_px, 1e-3) << j;
    EXPECT_NEAR(found[0].pose.keypoints[j].y_px, person.keypoints[j].y_px, 1e-3) << j;
  }
  for (size_t j = 15; j < kJoints; ++j) EXPECT_LT(found[0].pose.keypoints[j].score, 0.35) << j;
}

}  // namespace
}  // namespace mvstudio::detect::internal
