#include "avatar/body/template_atlas.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "avatar/body/atlas_charts.h"
#include "avatar/body/role_bones.h"
#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;

// Pieces of the surface with charts of their own. The limbs' pieces follow, left before right.
constexpr int kTrunkPiece = 0, kHeadPiece = 1, kFirstLimbPiece = 2, kLimbPieces = 6, kNumPieces = 14;
enum LimbPiece { kUpperArmPiece, kForearmPiece, kHandPiece, kThighPiece, kShinPiece, kFootPiece };

int PieceOf(BoneRole role) {
  using Role = BoneRole;
  static constexpr Role kLimbs[] = {Role::kLeftUpperArm, Role::kLeftForearm, Role::kLeftHand,      Role::kLeftThigh,
                                    Role::kLeftShin,     Role::kLeftFoot,    Role::kRightUpperArm, Role::kRightForearm,
                                    Role::kRightHand,    Role::kRightThigh,  Role::kRightShin,     Role::kRightFoot};
  if (role == Role::kNeck || role == Role::kHead) return kHeadPiece;
  const auto* const found = std::find(std::begin(kLimbs), std::end(kLimbs), role);
  return found == std::end(kLimbs) ? kTrunkPiece : kFirstLimbPiece + static_cast<int>(found - std::begin(kLimbs));
}

struct Pieces {
  Eigen::MatrixXf weights;                             // (14, V) how much a vertex belongs to each
  std::array<std::vector<Vector3d>, kNumPieces> mine;  // the vertices that belong to one most
};

Pieces FindPieces(const BodyTemplate& body) {
  const std::vector<BoneRole> roles = InheritedRoles(body);
  Pieces pieces;
  pieces.weights.setZero(kNumPieces, body.vertices.cols());
  for (Eigen::Index i = 0; i < body.vertices.cols(); ++i) {
    for (int k = 0; k < 4; ++k) pieces.weights(PieceOf(roles[body.skin_bones(k, i)]), i) += body.skin_weights(k, i);
    int most = 0;
    pieces.weights.col(i).maxCoeff(&most);
    pieces.mine[most].push_back(body.vertices.col(i).cast<double>());
  }
  return pieces;
}

Vector3d Mean(const std::vector<Vector3d>& points) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& x : points) sum += x;
  return sum / std::max<double>(1, static_cast<double>(points.size()));
}

/// The axis with the median distance of the piece's vertices from it.
RegionAxis WithRadius(RegionAxis axis, const std::vector<Vector3d>& points) {
  const Vector3d w = (axis.end - axis.begin).normalized();
  std::vector<double> radii;
  for (const Vector3d& x : points) radii.push_back((x - axis.begin).cross(w).norm());
  axis.arc_m = std::max(UpperMedian(std::move(radii), 0.05), 1e-3);
  return axis;
}

RegionAxis TrunkAxis(const BodyTemplate& body, const std::vector<Vector3d>& points) {
  const Vector3d neck = body.coco19.col(0), hips = body.coco19.col(2);
  const double height = neck[2] - hips[2], y = Mean(points)[1];
  return WithRadius({{hips[0], y, hips[2] - 0.06 * height}, {hips[0], y, neck[2] - 0.16 * height}, {0, -1, 0}, 2, 1, 0},
                    points);
}

/// Middle of the bounds of the points between two heights, or of all where there are none: densely meshed faces do not count
/// more.
Vector3d MiddleBetween(const std::vector<Vector3d>& points, double bottom, double top) {
  Vector3d low = Vector3d::Constant(1e9), high = -low;
  for (const Vector3d& x : points) {
    if (x[2] >= bottom && x[2] <= top) low = low.cwiseMin(x), high = high.cwiseMax(x);
  }
  return low[0] <= high[0] ? Vector3d(0.5 * (low + high)) : Mean(points);
}

/// Through the middle of the neck and of the skull, ending where its top begins to close.
RegionAxis HeadAxis(const BodyTemplate& body, const RoleBones& bones, const std::vector<Vector3d>& points) {
  const double low = body.bone_heads(2, bones.neck.front()), mid = body.bone_heads(2, bones.head);
  double top = mid;
  for (const Vector3d& x : points) top = std::max(top, x[2]);
  const Vector3d begin = MiddleBetween(points, low - 1, low + 0.2 * (mid - low));
  const Vector3d end = MiddleBetween(points, mid + 0.4 * (top - mid), top);
  const double x = body.bone_heads(0, bones.head);
  return WithRadius({{x, begin[1], low}, {x, end[1], mid + 0.57 * (top - mid)}, {1, 0, 0}, 24, 23, 0}, points);
}

/// From above the heel to before the tips of the toes.
RegionAxis FootAxis(const Vector3d& ankle, int part, const std::vector<Vector3d>& points) {
  double sole = ankle[2], front = ankle[1];
  for (const Vector3d& x : points) sole = std::min(sole, x[2]), front = std::min(front, x[1]);
  const double length = std::max(ankle[1] - front, 1e-3);
  std::vector<Vector3d> toes;
  for (const Vector3d& x : points) {
    if (x[1] < front + 0.25 * length) toes.push_back(x);
  }
  const Vector3d begin(ankle[0], ankle[1] + 0.1 * length, 0.5 * (ankle[2] + sole)), end = toes.empty() ? ankle : Mean(toes);
  return WithRadius({begin, end, {0, 0, 1}, part, part, 0}, points);
}

RegionAxis LimbAxis(const BodyTemplate& body, const RoleBones& bones, int limb, int side, const std::vector<Vector3d>& points) {
  static constexpr int kParts[2][kLimbPieces][2] = {{{17, 15}, {21, 19}, {4, 4}, {10, 8}, {14, 12}, {5, 5}},
                                                    {{18, 16}, {22, 20}, {3, 3}, {9, 7}, {13, 11}, {6, 6}}};
  const int* const parts = kParts[side][limb];
  const int bone = limb < kThighPiece ? bones.arms[side][limb + 1] : bones.legs[side][limb - kThighPiece];
  const Vector3d head = body.bone_heads.col(bone), tail = body.bone_tails.col(bone);
  if (limb == kFootPiece) return FootAxis(head, parts[0], points);
  const Vector3d front = limb < kThighPiece ? Vector3d(side == 0 ? 1 : -1, 0, 1) : Vector3d(0, -1, 0);
  return WithRadius({head, tail, front, parts[0], parts[1], 0}, points);
}

/// The two sides of a hand next to each other, seen from where it is flattest.
struct FlatChart {
  Vector3d origin, along, across, normal;
  double half_width;

  void Chart(int part, int f, BodyTemplate* body) const {
    const Eigen::Matrix3d x = FaceCorners(*body, f);
    const bool palm = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0)).dot(normal) > 0;
    body->face_part[f] = part;
    for (int k = 0; k < 3; ++k) {
      const double lateral = (x.col(k) - origin).dot(across) / half_width, u = 0.5 - 0.5 * lateral;
      body->face_uv.col(3 * f + k) = Eigen::Vector2d(palm ? -u : u, (x.col(k) - origin).dot(along)).cast<float>();
    }
  }
};

FlatChart HandChart(const RegionAxis& axis, const std::vector<Vector3d>& points) {
  FlatChart chart;
  chart.origin = Mean(points);
  chart.along = (axis.end - axis.begin).normalized();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& x : points) {
    const Vector3d d = x - chart.origin, across = d - chart.along * chart.along.dot(d);
    spread += across * across.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread);  // smallest: along the hand, then its normal
  chart.across = solver.eigenvectors().col(2);
  if (chart.across[1] > 0) chart.across *= -1;  // forwards
  chart.normal = chart.along.cross(chart.across);
  const double inwards = axis.begin[0] > 0 ? -0.5 : 0.5;
  if (chart.normal.dot(Vector3d(inwards, -0.2, -1)) < 0) chart.normal *= -1;  // as the palm
  chart.half_width = 1e-3;
  for (const Vector3d& x : points)
    chart.half_width = std::max(chart.half_width, std::abs((x - chart.origin).dot(chart.across)));
  return chart;
}

struct PieceCharts {
  std::array<RegionAxis, kNumPieces> axes;
  std::array<FlatChart, 2> hands;  // left, right
};

PieceCharts FindCharts(const BodyTemplate& body, const Pieces& pieces) {
  const RoleBones bones = FindRoleBones(body);
  PieceCharts charts;
  charts.axes[kTrunkPiece] = TrunkAxis(body, pieces.mine[kTrunkPiece]);
  charts.axes[kHeadPiece] = HeadAxis(body, bones, pieces.mine[kHeadPiece]);
  for (int side = 0; side < 2; ++side) {
    for (int limb = 0; limb < kLimbPieces; ++limb) {
      const int piece = kFirstLimbPiece + side * kLimbPieces + limb;
      charts.axes[piece] = LimbAxis(body, bones, limb, side, pieces.mine[piece]);
    }
    const int hand = kFirstLimbPiece + side * kLimbPieces + kHandPiece;
    charts.hands[side] = HandChart(charts.axes[hand], pieces.mine[hand]);
  }
  return charts;
}

}  // namespace

void BuildTemplateAtlas(BodyTemplate* body) {
  MVS_CHECK(body->skin_bones.cols() == body->vertices.cols(), "the template has no skin weights");
  const Pieces pieces = FindPieces(*body);
  const PieceCharts charts = FindCharts(*body, pieces);
  const int num_faces = static_cast<int>(body->faces.cols());
  body->face_part.resize(num_faces);
  body->face_uv.resize(2, 3 * num_faces);
  for (int f = 0; f < num_faces; ++f) {
    int piece = 0;
    const Eigen::VectorXf weights =
        pieces.weights.col(body->faces(0, f)) + pieces.weights.col(body->faces(1, f)) + pieces.weights.col(body->faces(2, f));
    weights.maxCoeff(&piece);
    const int limb = piece - kFirstLimbPiece;
    if (limb >= 0 && limb % kLimbPieces == kHandPiece) {
      charts.hands[limb / kLimbPieces].Chart(charts.axes[piece].front_part, f, body);
    } else {
      ChartFace(charts.axes[piece], f, body);
    }
  }
  NormalizeCharts(body);
}

}  // namespace mvstudio::body
