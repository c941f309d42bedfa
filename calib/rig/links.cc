#include "calib/rig/links.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "calib/board/homography.h"
#include "geometry/rigid/decompositions.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;
using geometry::Rigid3;
using Marks = Eigen::Matrix<double, 3, 6>;

/// Two posed views of one frame that relate two nodes.
struct PosedViewPair {
  const PosedView *a = nullptr, *b = nullptr;
  bool direct = false;  // without a detour over other cameras or boards
};

using PairMap = std::map<std::pair<int, int>, std::vector<PosedViewPair>>;

/// The relative pose by one pair of posed views and the points that it was measured at.
struct Measurement {
  Rigid3 a_from_b;
  Marks marks_in_b;
  double depth = 1;
  int corners = 0;
};

/// At most `count` elements, evenly spread.
template <class T>
std::vector<T> Thin(const std::vector<T>& all, size_t count) {
  if (all.size() <= count) return all;
  std::vector<T> some;
  for (size_t i = 0; i < count; ++i) some.push_back(all[i * all.size() / count]);
  return some;
}

double Disagreement(const Rigid3& a_from_b, const Measurement& m) {
  double sum = 0;
  for (Index i = 0; i < m.marks_in_b.cols(); ++i) {
    const Eigen::Vector3d mark = m.marks_in_b.col(i);
    sum += (a_from_b * mark - m.a_from_b * mark).norm();
  }
  return sum / (static_cast<double>(m.marks_in_b.cols()) * m.depth);
}

/// Weighted least squares of where a_from_b puts the marks (Umeyama 1991); `anchor`: their weighted mean in b.
Rigid3 FitMarks(const std::vector<Measurement>& measurements, const Eigen::VectorXd& weights, Eigen::Vector3d* anchor) {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  double total = 0;
  for (size_t k = 0; k < measurements.size(); ++k) {
    const Eigen::Vector3d middle = measurements[k].marks_in_b.rowwise().mean();
    const double w = weights[static_cast<Index>(k)];
    mean_b += w * middle, mean_a += w * (measurements[k].a_from_b * middle), total += w;
  }
  mean_a /= total, mean_b /= total;
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  for (size_t k = 0; k < measurements.size(); ++k) {
    for (Index i = 0; i < measurements[k].marks_in_b.cols(); ++i) {
      const Eigen::Vector3d mark = measurements[k].marks_in_b.col(i);
      cross += weights[static_cast<Index>(k)] * (measurements[k].a_from_b * mark - mean_a) * (mark - mean_b).transpose();
    }
  }
  const Eigen::Matrix3d rotation = geometry::ProcrustesRotation(cross);
  *anchor = mean_b;
  return {Eigen::Quaterniond(rotation).normalized(), mean_a - rotation * mean_b};
}

/// The measurement with the smallest median disagreement with all.
Rigid3 BestMeasurement(const std::vector<Measurement>& measurements, double* median) {
  constexpr size_t kMaxCandidates = 16;
  Rigid3 best;
  *median = std::numeric_limits<double>::infinity();
  for (const Measurement& candidate : Thin(measurements, kMaxCandidates)) {
    Eigen::VectorXd scores(static_cast<Index>(measurements.size()));
    for (size_t k = 0; k < measurements.size(); ++k) {
      scores[static_cast<Index>(k)] = Disagreement(candidate.a_from_b, measurements[k]);
    }
    const double score = Median(scores);
    if (score < *median) *median = score, best = candidate.a_from_b;
  }
  return best;
}

PoseLink FitLink(int a, int b, const std::vector<Measurement>& measurements) {
  constexpr int kIterations = 8;
  constexpr double kFloor = 1e-3, kAgrees = 0.02;  // relative to the distance
  PoseLink link;
  link.a = a, link.b = b;
  double median = 0;
  link.a_from_b = BestMeasurement(measurements, &median);
  const double scale = std::max(kFloor, 2 * median);
  Eigen::VectorXd weights(static_cast<Index>(measurements.size()));
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (size_t k = 0; k < measurements.size(); ++k) {
      const double ratio = Disagreement(link.a_from_b, measurements[k]) / scale;
      weights[static_cast<Index>(k)] = measurements[k].corners / (measurements[k].depth * measurements[k].depth) /
                                       ((1 + ratio * ratio) * (1 + ratio * ratio));
    }
    link.a_from_b = FitMarks(measurements, weights, &link.anchor_in_b);
  }
  link.weight = 0;
  for (const Measurement& m : measurements) {
    const double ratio = Disagreement(link.a_from_b, m) / kAgrees;
    link.weight += m.corners / (1 + ratio * ratio);
  }
  link.weight = std::max(1e-6, link.weight);
  return link;
}

template <class Measure>
std::vector<PoseLink> FitLinks(const PairMap& pairs, const Measure& measure) {
  constexpr size_t kMaxMeasurements = 80;
  std::vector<PoseLink> links;
  for (const auto& [nodes, all] : pairs) {
    std::vector<PosedViewPair> chosen;
    std::copy_if(all.begin(), all.end(), std::back_inserter(chosen), [](const PosedViewPair& pair) { return pair.direct; });
    if (chosen.empty()) chosen = all;
    const double kept = std::max(1.0, static_cast<double>(chosen.size()) / kMaxMeasurements);
    std::vector<Measurement> measurements;
    for (const PosedViewPair& pair : Thin(chosen, kMaxMeasurements)) measurements.push_back(measure(*pair.a, *pair.b));
    links.push_back(FitLink(nodes.first, nodes.second, measurements));
    links.back().weight *= kept;
  }
  return links;
}

/// `pose_a * pose_b^-1`, the identity for one and the same node.
Rigid3 Between(const PosedGroups& nodes, int a, int b) {
  return a == b ? Rigid3() : nodes.poses[a] * geometry::Inverse(nodes.poses[b]);
}

Marks BothMarks(const Eigen::Matrix3d& first, const Eigen::Matrix3d& second) {
  Marks marks;
  marks << first, second;
  return marks;
}

Eigen::Matrix3d Move(const Rigid3& b_from_a, const Eigen::Matrix3d& in_a) {
  Eigen::Matrix3d in_b;
  for (int i = 0; i < 3; ++i) in_b.col(i) = b_from_a * Eigen::Vector3d(in_a.col(i));
  return in_b;
}

bool MakePosedView(const View& view, const Rigid3& cam_from_board, int camera, PosedView* observation) {
  if (!cam_from_board.rotation.coeffs().allFinite() || !cam_from_board.translation.allFinite()) return false;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double square = 0;
  for (Index i = 0; i < view.size(); ++i) {
    if (view.weights[i] > 0) middle += view.x_in_board.col(i), ++observation->corners;
  }
  if (observation->corners < 4) return false;
  middle /= observation->corners;
  for (Index i = 0; i < view.size(); ++i) {
    if (view.weights[i] > 0) square += (view.x_in_board.col(i) - middle).squaredNorm();
  }
  const double radius = std::sqrt(square / observation->corners);
  observation->camera = camera, observation->frame = view.frame, observation->board = view.board, observation->view = &view;
  observation->cam_from_board = cam_from_board;
  observation->marks_in_board << middle, middle + radius * Eigen::Vector3d::UnitX(), middle + radius * Eigen::Vector3d::UnitY();
  observation->depth = std::max(1e-9, (cam_from_board * middle).norm());
  return true;
}

}  // namespace

PosedGroups SingleNodes(int num_nodes) { return PoseByLinks(num_nodes, {}, {}, false); }

PosedGroups PoseByLinks(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known, bool averaged) {
  PosedGroups nodes;
  nodes.groups = LinkedGroups(num_nodes, links, known);
  nodes.group_of.resize(num_nodes);
  for (size_t g = 0; g < nodes.groups.size(); ++g) {
    for (int node : nodes.groups[g]) nodes.group_of[node] = static_cast<int>(g);
  }
  nodes.poses = ChainPoses(num_nodes, links, known);
  if (averaged) {
    AverageRotations(links, known, &nodes.poses);
    AverageTranslations(links, known, &nodes.poses);
  }
  return nodes;
}

std::vector<PosedViews> CollectPosedViews(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board,
                                          const std::vector<int>& rank) {
  std::map<int, PosedViews> by_frame;
  for (size_t v = 0; v < views.size(); ++v) {
    PosedView observation;
    if (MakePosedView(views[v], cam_from_board[v], rank[views[v].camera_idx], &observation))
      by_frame[observation.frame].push_back(observation);
  }
  std::vector<PosedViews> frames;
  for (auto& [frame, observations] : by_frame) {
    std::stable_sort(observations.begin(), observations.end(), [](const PosedView& a, const PosedView& b) {
      return std::tie(a.camera, a.board) < std::tie(b.camera, b.board);
    });
    frames.push_back(std::move(observations));
  }
  return frames;
}

std::vector<PoseLink> LinkCameras(const std::vector<PosedViews>& frames, const PosedGroups& boards) {
  PairMap pairs;
  for (const PosedViews& frame : frames) {
    for (const PosedView& a : frame) {
      for (const PosedView& b : frame) {
        if (a.camera >= b.camera || !boards.Linked(a.board, b.board)) continue;
        pairs[{a.camera, b.camera}].push_back({&a, &b, a.board == b.board});
      }
    }
  }
  return FitLinks(pairs, [&](const PosedView& a, const PosedView& b) {
    Measurement m;
    const Rigid3 b_from_board = b.cam_from_board * Between(boards, b.board, a.board);
    m.a_from_b = a.cam_from_board * geometry::Inverse(b_from_board);
    m.marks_in_b = BothMarks(Move(b_from_board, a.marks_in_board), Move(b.cam_from_board, b.marks_in_board));
    m.depth = (a.depth + b.depth) / 2, m.corners = std::min(a.corners, b.corners);
    return m;
  });
}

std::vector<PoseLink> LinkBoards(const std::vector<PosedViews>& frames, const PosedGroups& cameras) {
  PairMap pairs;
  for (const PosedViews& frame : frames) {
    for (const PosedView& p : frame) {
      for (const PosedView& q : frame) {
        if (p.board >= q.board || !cameras.Linked(p.camera, q.camera)) continue;
        pairs[{p.board, q.board}].push_back({&p, &q, p.camera == q.camera});
      }
    }
  }
  return FitLinks(pairs, [&](const PosedView& p, const PosedView& q) {
    Measurement m;
    const Rigid3 p_cam_from_q = Between(cameras, p.camera, q.camera) * q.cam_from_board;
    m.a_from_b = geometry::Inverse(p.cam_from_board) * p_cam_from_q;
    m.marks_in_b = BothMarks(Move(geometry::Inverse(m.a_from_b), p.marks_in_board), q.marks_in_board);
    m.depth = (p.depth + q.depth) / 2, m.corners = std::min(p.corners, q.corners);
    return m;
  });
}

double MarksMoved(const PosedView& observation, const Rigid3& cam_from_board) {
  double sum = 0;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d mark = observation.marks_in_board.col(i);
    sum += (cam_from_board * mark - observation.cam_from_board * mark).norm();
  }
  return sum / (3 * observation.depth);
}

}  // namespace mvstudio::calib
