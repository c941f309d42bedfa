#include "avatar/run/lift/pose_variation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/units.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;
using Eigen::Vector3d;

constexpr int kCentre = 2;
/// Each joint's neighbour towards the centre, parents before children, how freely it turns about that neighbour, and which
/// length it shares with others: left and right, and the joints of the head.
struct Link {
  int joint, parent;
  double freedom;
  int length;
};
constexpr Link kLinks[] = {{0, 2, 1, 0}, {6, 2, 0, 1},   {12, 2, 0, 1}, {1, 0, 0.5, 2}, {3, 0, 0.3, 3}, {9, 0, 0.3, 3},
                           {4, 3, 1, 4}, {10, 9, 1, 4},  {7, 6, 1, 5},  {13, 12, 1, 5}, {5, 4, 1, 6},   {11, 10, 1, 6},
                           {8, 7, 1, 7}, {14, 13, 1, 7}, {15, 1, 0, 2}, {17, 1, 0, 2},  {16, 15, 0, 2}, {18, 17, 0, 2}};
constexpr int kLengths = 8;
constexpr std::pair<int, int> kMirror[] = {{3, 9}, {4, 10}, {5, 11}, {6, 12}, {7, 13}, {8, 14}, {15, 17}, {16, 18}};

Vector3d RandomDirection(Rng& rng) {
  const double z = rng.Uniform(-1, 1), angle = rng.Uniform(0, 2 * kPi), r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

double RandomFactor(double spread, Rng& rng) { return std::exp(spread * std::clamp(rng.Normal(), -2.0, 2.0)); }

}  // namespace

void DrawTurns(double jitter_rad, Rng& rng, PoseVariation* variation) {
  for (const Link& link : kLinks) {
    const Vector3d turn = jitter_rad * link.freedom * rng.Normal() * RandomDirection(rng);
    variation->turns[link.joint] = geometry::RotationExp(turn).toRotationMatrix();
  }
}

void DrawLengths(double spread, Rng& rng, PoseVariation* variation) {
  const double whole = RandomFactor(spread, rng);
  std::array<double, kLengths> own{};
  for (double& factor : own) factor = whole * RandomFactor(spread, rng);
  for (const Link& link : kLinks) variation->lengths[link.joint] = own[link.length];
}

Coco19Pose Varied(const Coco19Pose& pose, const PoseVariation& variation) {
  Coco19Pose out = pose;
  std::array<Eigen::Matrix3d, 19> total;
  std::array<int, 19> anchor{};  // nearest valid joint towards the centre, itself included
  total.fill(Eigen::Matrix3d::Identity());
  anchor.fill(kCentre);
  for (const Link& link : kLinks) {
    const int from = anchor[link.parent];
    total[link.joint] = total[link.parent] * variation.turns[link.joint];
    anchor[link.joint] = pose.valid[link.joint] ? link.joint : from;
    if (!pose.valid[link.joint]) continue;
    out.x_in_world.col(link.joint) =
        out.x_in_world.col(from) +
        total[link.joint] * (variation.lengths[link.joint] * (pose.x_in_world.col(link.joint) - pose.x_in_world.col(from)));
  }
  return out;
}

Coco19Pose Mirrored(const Coco19Pose& pose) {
  Coco19Pose out = pose;
  for (const auto& [left, right] : kMirror) {
    out.x_in_world.col(left).swap(out.x_in_world.col(right));
    std::swap(out.valid[left], out.valid[right]);
    std::swap(out.confidence[left], out.confidence[right]);
  }
  out.x_in_world.row(0) *= -1;
  return out;
}

}  // namespace mvstudio::avatar
