#include "calib/points/point_problem.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/parallel.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib {
namespace {

using Matrix26 = Eigen::Matrix<double, 2, 6>;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Matrix2X = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, 32>;

constexpr int kChunks = 4;  // partial sums, added in order, so that the number of threads does not matter

bool IsFixed(const std::vector<bool>& fixed, size_t i) { return i < fixed.size() && fixed[i]; }

int CountFree(size_t count, const std::vector<bool>& fixed) {
  int free = 0;
  for (size_t i = 0; i < count; ++i) free += !IsFixed(fixed, i);
  return free;
}

}  // namespace

struct PointProblem::Partial {
  double cost = 0;
  Eigen::MatrixXd h;  // lower
  Eigen::VectorXd g;
};

/// Weighted residual and its derivatives.
struct PointProblem::Derivatives {
  Eigen::Vector2d r;
  Matrix2X lens;
  Matrix26 camera;
  Matrix23 point;
};

PointProblem::PointProblem(const PointScene& scene, const std::vector<PointObservation>& observations,
                           const PointBundleOptions& options, Blocks blocks, double robust_px)
    : observations_(observations), options_(options), blocks_(blocks), robust_px_(robust_px), current_(scene), trial_(scene) {
  for (size_t l = 0; l < scene.lenses.size(); ++l) {
    const Eigen::Index params = scene.lenses[l].params.size();
    directions_.push_back(l < options.lens_directions.size() ? options.lens_directions[l] : Eigen::MatrixXd(params, 0));
    MVS_CHECK(directions_[l].rows() == params && directions_[l].cols() <= kMaxLensDirections, "directions of lens " << l);
  }
  PlaceUnknowns();
  CollectTerms();
}

PointProblem::Blocks PointProblem::ChooseBlocks(const PointScene& scene, const PointBundleOptions& options) {
  const int cameras = CountFree(scene.cam_from_world.size(), options.fix_camera);
  const int points = CountFree(static_cast<size_t>(scene.points.cols()), options.fix_point);
  return options.distance || 6 * cameras <= 3 * points ? Blocks::kPoints : Blocks::kCameras;
}

void PointProblem::PlaceUnknowns() {
  const bool points_are_blocks = blocks_ == Blocks::kPoints;
  for (const Eigen::MatrixXd& directions : directions_) {
    lens_column_.push_back(directions.cols() > 0 ? num_global_ : -1);
    num_global_ += static_cast<int>(directions.cols());
  }
  camera_column_.assign(current_.cam_from_world.size(), -1);
  camera_block_ = camera_column_;
  point_column_.assign(static_cast<size_t>(current_.points.cols()), -1);
  point_block_ = point_column_;
  for (size_t c = 0; c < camera_column_.size(); ++c) {
    if (IsFixed(options_.fix_camera, c)) continue;
    if (!points_are_blocks) {
      camera_block_[c] = num_blocks_++;
      continue;
    }
    camera_column_[c] = num_global_;
    num_global_ += 6;
  }
  for (size_t p = 0; p < point_column_.size(); ++p) {
    if (IsFixed(options_.fix_point, p)) continue;
    if (points_are_blocks) {
      point_block_[p] = num_blocks_++;
      continue;
    }
    point_column_[p] = num_global_;
    num_global_ += 3;
  }
}

void PointProblem::CollectTerms() {
  const bool points_are_blocks = blocks_ == Blocks::kPoints;
  std::vector<std::vector<Term>> of_block(static_cast<size_t>(num_blocks_) + 1);
  for (const PointObservation& observation : observations_) {
    if (!(observation.weight > 0)) continue;
    const auto c = static_cast<size_t>(observation.camera_idx), p = static_cast<size_t>(observation.point_idx);
    Term term;
    term.observation = &observation;
    term.block = points_are_blocks ? point_block_[p] : camera_block_[c];
    term.lens = lens_column_[static_cast<size_t>(current_.lens_of_camera[c])];
    term.other = points_are_blocks ? camera_column_[c] : point_column_[p];
    of_block[static_cast<size_t>(term.block < 0 ? num_blocks_ : term.block)].push_back(term);
  }
  Eigen::Index begin = 0;
  columns_of_block_.resize(static_cast<size_t>(num_blocks_));
  for (size_t b = 0; b < of_block.size(); ++b) {
    term_begin_.push_back(terms_.size());
    std::vector<int> columns;
    for (const Term& term : of_block[b]) {
      const auto lens = static_cast<size_t>(current_.lens_of_camera[static_cast<size_t>(term.observation->camera_idx)]);
      for (int k = 0; k < directions_[lens].cols(); ++k) columns.push_back(term.lens + k);
      for (int k = 0; term.other >= 0 && k < (points_are_blocks ? 6 : 3); ++k) columns.push_back(term.other + k);
    }
    std::sort(columns.begin(), columns.end());
    columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
    const auto place = [&](int column) {
      return begin + (std::lower_bound(columns.begin(), columns.end(), column) - columns.begin());
    };
    for (Term& term : of_block[b]) {
      term.lens_in_w = place(term.lens), term.other_in_w = place(term.other);
      terms_.push_back(term);
    }
    if (b == columns_of_block_.size()) continue;
    begin += static_cast<Eigen::Index>(columns.size());
    columns_of_block_[b] = std::move(columns);
  }
  term_begin_.push_back(terms_.size());
}

void PointProblem::AllocateSystem(SchurSystem* system) const {
  Allocate(num_global_, blocks_ == Blocks::kPoints ? 3 : 6, columns_of_block_, system);
}

void PointProblem::Try(const Eigen::VectorXd& global, const Eigen::MatrixXd& blocks) {
  for (size_t l = 0; l < directions_.size(); ++l) {
    trial_.lenses[l].params = current_.lenses[l].params;
    if (lens_column_[l] >= 0)
      trial_.lenses[l].params += directions_[l] * global.segment(lens_column_[l], directions_[l].cols());
  }
  for (size_t c = 0; c < camera_column_.size(); ++c) {
    geometry::Vector6d delta = geometry::Vector6d::Zero();
    if (camera_column_[c] >= 0) delta = global.segment<6>(camera_column_[c]);
    if (camera_block_[c] >= 0) delta = blocks.col(camera_block_[c]);
    trial_.cam_from_world[c] =
        delta.isZero(0) ? current_.cam_from_world[c] : geometry::Perturb(delta, current_.cam_from_world[c]);
  }
  for (size_t p = 0; p < point_column_.size(); ++p) {
    const auto i = static_cast<Eigen::Index>(p);
    trial_.points.col(i) = current_.points.col(i);
    if (point_column_[p] >= 0) trial_.points.col(i) += global.segment<3>(point_column_[p]);
    if (point_block_[p] >= 0) trial_.points.col(i) += blocks.col(point_block_[p]);
  }
}

/// False where the observation does not project.
bool PointProblem::Linearize(const PointObservation& observation, double* cost, Derivatives* out) const {
  const auto camera = static_cast<size_t>(observation.camera_idx), lens = static_cast<size_t>(trial_.lens_of_camera[camera]);
  const geometry::Rigid3& cam_from_world = trial_.cam_from_world[camera];
  const Eigen::Matrix3d cam_r_world = cam_from_world.rotation.toRotationMatrix();
  const Eigen::Vector3d rotated = cam_r_world * trial_.points.col(observation.point_idx);
  geometry::LensDerivatives d;
  Eigen::Vector2d px;
  if (!geometry::ProjectLens(trial_.lenses[lens], rotated + cam_from_world.translation, &px, &d)) return false;
  double scale = std::sqrt(observation.weight);
  const double squared = scale * scale * (px - observation.px).squaredNorm(), c2 = robust_px_ * robust_px_;
  if (robust_px_ > 0) {
    *cost += c2 * std::log1p(squared / c2);
    scale /= std::sqrt(1 + squared / c2);
  } else {
    *cost += squared;
  }
  out->r = scale * (px - observation.px);
  const Eigen::MatrixXd& directions = directions_[lens];
  out->lens = Matrix2X::Zero(2, directions.cols());
  for (int i = 0; directions.cols() > 0 && i < d.count; ++i) {
    const int parameter = d.columns[static_cast<size_t>(i)];
    for (Eigen::Index k = 0; k < directions.cols(); ++k) out->lens.col(k) += scale * directions(parameter, k) * d.d_px.col(i);
  }
  const Matrix23 d_x = scale * d.d_px_d_x_in_cam;
  out->camera.leftCols<3>() = -d_x * geometry::CrossMatrix(rotated);
  out->camera.rightCols<3>() = d_x;
  out->point = d_x * cam_r_world;
  return true;
}

/// Adds one observation: to the global sums of `partial`, and to its block's own columns of `system`, which no other thread
/// touches.
bool PointProblem::AddTerm(const Term& term, Partial* partial, SchurSystem* system) const {
  Derivatives d;
  if (!Linearize(*term.observation, &partial->cost, &d)) return false;
  const Eigen::Index k = d.lens.cols();
  if (k > 0) {
    partial->h.block(term.lens, term.lens, k, k).noalias() += d.lens.transpose() * d.lens;
    partial->g.segment(term.lens, k).noalias() += d.lens.transpose() * d.r;
  }
  if (blocks_ == Blocks::kPoints) {
    AddProducts<3, 6>(term, d, d.point, d.camera, partial, system);
  } else {
    AddProducts<6, 3>(term, d, d.camera, d.point, partial, system);
  }
  return true;
}

template <int kBlock, int kOther>
void PointProblem::AddProducts(const Term& term, const Derivatives& d, const Eigen::Matrix<double, 2, kBlock>& j_block,
                               const Eigen::Matrix<double, 2, kOther>& j_other, Partial* partial, SchurSystem* system) const {
  const Eigen::Index k = d.lens.cols();
  if (term.other >= 0) {
    partial->h.block<kOther, kOther>(term.other, term.other).noalias() += j_other.transpose() * j_other;
    partial->g.segment<kOther>(term.other).noalias() += j_other.transpose() * d.r;
    if (k > 0) partial->h.block(term.other, term.lens, kOther, k).noalias() += j_other.transpose() * d.lens;
  }
  if (term.block < 0) return;
  const Eigen::Index b = term.block;
  system->block_h.block<kBlock, kBlock>(0, b * kBlock).noalias() += j_block.transpose() * j_block;
  system->block_g.block<kBlock, 1>(0, b).noalias() += j_block.transpose() * d.r;
  if (k > 0) system->w.block(0, term.lens_in_w, kBlock, k).noalias() += j_block.transpose() * d.lens;
  if (term.other >= 0) system->w.block<kBlock, kOther>(0, term.other_in_w).noalias() += j_block.transpose() * j_other;
}

bool PointProblem::LinearizeTrial(SchurSystem* system) {
  system->SetZero();
  for (const geometry::Camera& lens : trial_.lenses) {
    if (!(lens.fx() > 0) || !(lens.fy() > 0) || !lens.params.allFinite()) return false;
  }
  std::vector<Partial> partial(kChunks);
  std::vector<char> ok(kChunks, 1);
  const auto groups = static_cast<int64_t>(term_begin_.size()) - 1;
  ParallelFor(kChunks, options_.num_threads, [&](int64_t chunk) {
    Partial& sum = partial[static_cast<size_t>(chunk)];
    sum.h.setZero(num_global_, num_global_);
    sum.g.setZero(num_global_);
    const size_t first = term_begin_[static_cast<size_t>(chunk * groups / kChunks)];
    const size_t last = term_begin_[static_cast<size_t>((chunk + 1) * groups / kChunks)];
    for (size_t i = first; i < last && ok[static_cast<size_t>(chunk)]; ++i) {
      ok[static_cast<size_t>(chunk)] = AddTerm(terms_[i], &sum, system);
    }
  });
  for (size_t i = 0; i < kChunks; ++i) {
    if (!ok[i]) return false;
    system->cost += partial[i].cost, system->h += partial[i].h, system->g += partial[i].g;
  }
  if (options_.distance) AddDistance(system);
  return std::isfinite(system->cost);
}

/// (|c_a - c_b| - distance) / sigma, with c = -R^T t.
void PointProblem::AddDistance(SchurSystem* system) const {
  const KnownDistance& known = *options_.distance;
  const auto centre = [&](int c) { return geometry::Inverse(trial_.cam_from_world[static_cast<size_t>(c)]).translation; };
  const Eigen::Vector3d between = centre(known.a) - centre(known.b);
  const double length = between.norm(), sigma = std::max(known.sigma, 1e-6 * known.distance);
  const double r = (length - known.distance) / sigma;
  system->cost += r * r;
  Eigen::VectorXd j = Eigen::VectorXd::Zero(num_global_);
  for (const int c : {known.a, known.b}) {
    const int column = camera_column_[static_cast<size_t>(c)];
    if (column < 0) continue;
    const geometry::Rigid3& cam_from_world = trial_.cam_from_world[static_cast<size_t>(c)];
    const Eigen::Matrix3d world_r_cam = cam_from_world.rotation.toRotationMatrix().transpose();
    const Eigen::Vector3d along = (c == known.a ? 1 : -1) * between / length;
    // R <- Exp(w) R turns the centre to -R^T Exp(-w) t: derivative -R^T [t]x for w, -R^T for t.
    j.segment<3>(column) =
        (-along.transpose() * world_r_cam * geometry::CrossMatrix(cam_from_world.translation)).transpose() / sigma;
    j.segment<3>(column + 3) = -(world_r_cam.transpose() * along) / sigma;
  }
  system->h.selfadjointView<Eigen::Lower>().rankUpdate(j);
  system->g += r * j;
}

}  // namespace mvstudio::calib
