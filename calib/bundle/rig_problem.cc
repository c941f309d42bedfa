#include "calib/bundle/rig_problem.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/check.h"
#include "core/parallel.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;
using geometry::Rigid3;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kChunks = 4;  // partial sums, added in order: the number of threads does not change the result

bool Flag(const std::vector<bool>& flags, size_t i) { return i < flags.size() && flags[i]; }

/// Left perturbation of a product by the left perturbation of one factor: product = before * factor * after.
Matrix6 FactorToProduct(const Rigid3& before, const Rigid3& factor, const Rigid3& after) {
  const Eigen::Matrix3d r = before.rotation.toRotationMatrix();
  Matrix6 m = Matrix6::Zero();
  m.topLeftCorner<3, 3>() = m.bottomRightCorner<3, 3>() = r;
  m.bottomLeftCorner<3, 3>() = -r * geometry::CrossMatrix(factor.rotation * after.translation);
  return m;
}

bool IsSplined(const geometry::Camera& camera) { return camera.model == geometry::LensModel::kSplined; }

}  // namespace

bool WithinBounds(const geometry::Camera& camera) {
  if (!geometry::WhyInvalidLens(camera).empty()) return false;
  const geometry::LensTraits& traits = geometry::TraitsOf(camera.model);
  for (int i = 0; i < traits.num_params; ++i) {
    if (!(camera.params[4 + i] >= traits.params[i].low && camera.params[4 + i] <= traits.params[i].high)) return false;
  }
  return true;
}

RigColumns MakeColumns(const std::vector<View>& views, const RigState& state, const BundleOptions& options) {
  const size_t cameras = state.cameras.size(), boards = state.rig_from_board.size();
  RigColumns columns;
  columns.lens.assign(cameras, -1), columns.first_param.assign(cameras, 0), columns.camera.assign(cameras, -1);
  columns.board.assign(boards, -1), columns.warp.assign(boards, -1), columns.stretch.assign(boards, -1),
      columns.time.assign(cameras, -1);
  columns.num_time = options.refine_rate ? 2 : 1;
  std::vector<bool> camera_seen(cameras, false), board_seen(boards, false), motion_seen(cameras, false);
  for (const View& view : views) {
    if (!(view.weights.array() > 0).any()) continue;
    camera_seen[view.camera_idx] = board_seen[view.board] = true;
    if (!state.board_velocity.empty() && !state.board_velocity[view.frame].isZero()) motion_seen[view.camera_idx] = true;
  }
  std::map<int, int> of_group;
  for (size_t c = 0; c < cameras; ++c) {
    if (!camera_seen[c]) continue;
    if (options.refine_intrinsics && !Flag(options.fix_lens, c)) {
      columns.first_param[c] = IsSplined(state.cameras[c]) ? 4 : 0;
      const int group = state.lens_group.empty() ? static_cast<int>(c) : state.lens_group[c];
      const auto [entry, is_new] = of_group.insert({group, columns.total});
      columns.lens[c] = entry->second;
      if (is_new) columns.total += columns.num_lens(static_cast<int>(c), state);
    }
    const bool gauge = options.gauge.kind == Gauge::Kind::kCamera && options.gauge.index == static_cast<int>(c);
    if (options.refine_cameras && !gauge && !Flag(options.fix_camera, c)) columns.camera[c] = columns.total, columns.total += 6;
    if (options.refine_time && static_cast<int>(c) != options.time_reference && motion_seen[c])
      columns.time[c] = columns.total, columns.total += columns.num_time;
  }
  for (size_t b = 0; b < boards; ++b) {
    if (!board_seen[b]) continue;
    if (options.refine_boards && b > 0 && !Flag(options.fix_board, b)) columns.board[b] = columns.total, columns.total += 6;
    if (options.refine_warp) columns.warp[b] = columns.total, columns.total += 2;
    if (options.refine_stretch && !state.board_stretch.empty()) columns.stretch[b] = columns.total, columns.total += 2;
  }
  return columns;
}

struct RigProblem::Partial {
  Eigen::MatrixXd h;
  Eigen::VectorXd g;
  double cost = 0;
  // Scratch of one view.
  Eigen::MatrixXd rows;        // (2 N, lens + rest), weighted
  Eigen::VectorXd residuals;   // (2 N)
  Eigen::MatrixXd lens_rest;   // (lens, rest)
  Eigen::MatrixXd rest_rest;   // (rest, rest)
  Eigen::VectorXd rest_right;  // (rest)
};

RigProblem::RigProblem(const std::vector<View>& views, const RigState& state, const BundleOptions& options)
    : views_(views), options_(options), columns_(MakeColumns(views, state, options)), state_(state), trial_(state) {
  std::map<int, std::vector<const View*>> by_frame;
  for (const View& view : views) {
    if ((view.weights.array() > 0).any()) by_frame[view.frame].push_back(&view);
  }
  for (const auto& [frame, list] : by_frame) {
    std::vector<bool> used(columns_.total, false);
    const auto use = [&](int first, int count) {
      for (int i = 0; first >= 0 && i < count; ++i) used[first + i] = true;
    };
    for (const View* view : list) {
      use(columns_.lens[view->camera_idx], columns_.num_lens(view->camera_idx, state));
      use(columns_.camera[view->camera_idx], 6), use(columns_.time[view->camera_idx], columns_.num_time);
      use(columns_.board[view->board], 6), use(columns_.warp[view->board], 2), use(columns_.stretch[view->board], 2);
    }
    std::vector<int> columns, position(columns_.total, -1);
    for (int i = 0; i < columns_.total; ++i) {
      if (used[i]) position[i] = static_cast<int>(columns.size()), columns.push_back(i);
    }
    frames_.push_back(frame);
    of_block_.push_back(list);
    columns_of_block_.push_back(std::move(columns));
    position_in_block_.push_back(std::move(position));
  }
}

void RigProblem::AllocateSystem(SchurSystem* system) const { Allocate(columns_.total, 6, columns_of_block_, system); }

int RigProblem::GaugeBlock() const {
  if (options_.gauge.kind != Gauge::Kind::kBoard) return -1;
  const auto found = std::find(frames_.begin(), frames_.end(), options_.gauge.index);
  return found == frames_.end() ? -1 : static_cast<int>(found - frames_.begin());
}

void RigProblem::Try(const Eigen::VectorXd& global, const Eigen::MatrixXd& blocks) {
  trial_ = state_;
  for (size_t c = 0; c < trial_.cameras.size(); ++c) {
    const int lens = columns_.num_lens(static_cast<int>(c), state_);
    if (lens > 0) trial_.cameras[c].params.tail(lens) += global.segment(columns_.lens[c], lens);
    if (columns_.camera[c] >= 0)
      trial_.cam_from_world[c] = geometry::Perturb(global.segment<6>(columns_.camera[c]), state_.cam_from_world[c]);
    if (columns_.time[c] >= 0) trial_.time_offset_frames[c] += global[columns_.time[c]];
    if (columns_.time[c] >= 0 && columns_.num_time > 1) trial_.time_rate[c] += global[columns_.time[c] + 1];
  }
  for (size_t b = 0; b < trial_.rig_from_board.size(); ++b) {
    if (columns_.board[b] >= 0)
      trial_.rig_from_board[b] = geometry::Perturb(global.segment<6>(columns_.board[b]), state_.rig_from_board[b]);
    if (columns_.warp[b] >= 0) trial_.board_warp_m[b] += global.segment<2>(columns_.warp[b]);
    if (columns_.stretch[b] >= 0) trial_.board_stretch[b] += global.segment<2>(columns_.stretch[b]);
  }
  for (size_t i = 0; i < frames_.size(); ++i)
    trial_.world_from_board[frames_[i]] = geometry::Perturb(blocks.col(i), state_.world_from_board[frames_[i]]);
}

bool RigProblem::LinearizeTrial(SchurSystem* system) {
  for (size_t c = 0; c < trial_.cameras.size(); ++c) {
    if (!WithinBounds(trial_.cameras[c])) return false;
  }
  system->SetZero();
  std::vector<Partial> partials(kChunks);
  std::vector<char> ok(kChunks, 1);
  const int blocks = static_cast<int>(frames_.size());
  ParallelFor(kChunks, options_.num_threads, [&](int64_t chunk) {
    Partial& partial = partials[chunk];
    partial.h.setZero(columns_.total, columns_.total);
    partial.g.setZero(columns_.total);
    const int first = static_cast<int>(chunk * blocks / kChunks), last = static_cast<int>((chunk + 1) * blocks / kChunks);
    for (int block = first; block < last && ok[chunk]; ++block) ok[chunk] = LinearizeFrame(block, system, &partial);
  });
  if (std::find(ok.begin(), ok.end(), 0) != ok.end()) return false;
  for (const Partial& partial : partials) system->h += partial.h, system->g += partial.g, system->cost += partial.cost;
  AddLensPrior(system);
  AddGivenPrior(system);
  return std::isfinite(system->cost);
}

bool RigProblem::LinearizeFrame(int block, SchurSystem* system, Partial* partial) const {
  for (const View* view : of_block_[block]) {
    if (!AddView(*view, block, system, partial)) return false;
  }
  if (block == GaugeBlock()) {
    system->block_h.middleCols<6>(6 * block).setIdentity();
    system->block_g.col(block).setZero();
    const Index begin = system->begin[block];
    system->w.middleCols(begin, system->begin[block + 1] - begin).setZero();
  }
  return true;
}

namespace {

/// Most numbers besides the lens that a view's corners meet.
constexpr int kMaxRest = 10;
using RestRows = Eigen::Matrix<double, 2, kMaxRest>;

/// Derivatives of one view with respect to its lens (dense part only) and the rest: the pose of its board in the camera
/// (6) and, where wanted, the warp (2) and the stretch (2). Splined lenses are summed up corner by corner, since a corner
/// depends on 18 of their hundreds of parameters.
struct ViewSums {
  const geometry::Camera& camera;
  int first_param, num_lens, lens_column, num_rest;
};

/// Of a corner's place on its board by shear and aspect.
Eigen::Matrix2d StretchDerivative(const Eigen::Vector3d& x_in_board) {
  Eigen::Matrix2d d;
  d << x_in_board.y(), x_in_board.x(), x_in_board.x(), -x_in_board.y();
  return d;
}

/// h += d^T d of the lens numbers that one corner meets, lens_rest += d^T rest.
void AddSparseCorner(const ViewSums& sums, const geometry::LensDerivatives& d, double scale, const Eigen::Vector2d& residual,
                     const RestRows& rest, Eigen::MatrixXd* h, Eigen::VectorXd* g, Eigen::MatrixXd* lens_rest) {
  for (int row = 0; row < 2; ++row) {
    int index[geometry::LensDerivatives::kMax];
    double value[geometry::LensDerivatives::kMax];
    int count = 0;
    for (int k = 0; k < d.count; ++k) {
      if (d.columns[k] < sums.first_param || d.d_px(row, k) == 0) continue;
      index[count] = d.columns[k] - sums.first_param;
      value[count++] = scale * d.d_px(row, k);
    }
    for (int j = 0; j < count; ++j) {
      double* target = h->data() + (sums.lens_column + index[j]) * h->rows() + sums.lens_column;
      for (int i = j; i < count; ++i) target[index[i]] += value[i] * value[j];
      (*g)[sums.lens_column + index[j]] += value[j] * residual[row];
      lens_rest->row(index[j]) += value[j] * rest.row(row).head(sums.num_rest);
    }
  }
}

}  // namespace

bool RigProblem::AddView(const View& view, int block, SchurSystem* system, Partial* partial) const {
  const int c = view.camera_idx, b = view.board, num_lens = columns_.num_lens(c, trial_);
  const geometry::Camera& camera = trial_.cameras[c];
  const bool warp = columns_.warp[b] >= 0, stretch = columns_.stretch[b] >= 0, sparse = num_lens > 0 && IsSplined(camera);
  const int num_rest = 6 + 2 * warp + 2 * stretch, dense_lens = sparse ? 0 : num_lens, width = dense_lens + num_rest;
  const Index n = view.size();
  const Rigid3 cam_from_board = CamFromBoard(view, trial_);
  const Eigen::Matrix3d rotation = cam_from_board.rotation.toRotationMatrix();
  const Eigen::Matrix3Xd corners = BentCorners(view, trial_);
  const ViewSums sums{camera, columns_.first_param[c], num_lens, columns_.lens[c], num_rest};
  partial->rows.setZero(2 * n, width);
  partial->residuals.setZero(2 * n);
  partial->lens_rest.setZero(num_lens, num_rest);
  geometry::LensDerivatives d;
  for (Index i = 0; i < n; ++i) {
    if (view.weights[i] <= 0) continue;
    const Eigen::Vector3d rotated = rotation * corners.col(i);
    Eigen::Vector2d px;
    if (!geometry::ProjectLens(camera, rotated + cam_from_board.translation, &px, &d)) return false;
    const double scale = std::sqrt(view.weights[i]);
    const Eigen::Matrix<double, 2, 3> d_x = scale * d.d_px_d_x_in_cam;
    const Eigen::Vector2d residual = scale * (px - view.px.col(i));
    RestRows rest;
    rest.leftCols<3>() = -d_x * geometry::CrossMatrix(rotated);
    rest.middleCols<3>(3) = d_x;
    if (warp) rest.middleCols<2>(6) = (d_x * rotation.col(2)) * view.warp_basis.col(i).transpose();
    if (stretch) rest.middleCols<2>(num_rest - 2) = d_x * rotation.leftCols<2>() * StretchDerivative(view.x_in_board.col(i));
    partial->residuals.segment<2>(2 * i) = residual;
    if (sparse) AddSparseCorner(sums, d, scale, residual, rest, &partial->h, &partial->g, &partial->lens_rest);
    for (int k = 0; k < dense_lens; ++k) partial->rows.block<2, 1>(2 * i, k) = scale * d.d_px.col(k);
    partial->rows.block(2 * i, dense_lens, 2, num_rest) = rest.leftCols(num_rest);
  }
  partial->cost += partial->residuals.squaredNorm();
  Eigen::MatrixXd local = Eigen::MatrixXd::Zero(width, width);
  local.selfadjointView<Eigen::Lower>().rankUpdate(partial->rows.transpose());
  const Eigen::VectorXd right = partial->rows.transpose() * partial->residuals;
  if (!sparse) partial->lens_rest = local.bottomLeftCorner(num_rest, num_lens).transpose();
  partial->rest_rest = local.bottomRightCorner(num_rest, num_rest).selfadjointView<Eigen::Lower>();
  partial->rest_right = right.tail(num_rest);
  for (int j = 0; j < dense_lens; ++j) {
    for (int i = j; i < dense_lens; ++i) partial->h(columns_.lens[c] + i, columns_.lens[c] + j) += local(i, j);
    partial->g[columns_.lens[c] + j] += right[j];
  }
  Expand(view, block, system, partial);
  return true;
}

/// From the pose of the board in the camera to the unknowns that make it up.
void RigProblem::Expand(const View& view, int block, SchurSystem* system, Partial* partial) const {
  const int c = view.camera_idx, b = view.board, num_rest = static_cast<int>(partial->rest_rest.rows());
  const Rigid3 &cam = trial_.cam_from_world[c], &rig = trial_.rig_from_board[b];
  Rigid3 world_from_board = trial_.world_from_board[view.frame];
  const bool moved = !trial_.time_offset_frames.empty();
  Matrix6 motion = Matrix6::Identity();  // of the moved board by the one in the frame
  if (moved) {
    const geometry::Vector6d step = BoardStep(view.frame, LateFrames(c, view.frame, trial_), trial_);
    world_from_board = geometry::Perturb(step, world_from_board);
    motion.topLeftCorner<3, 3>() = geometry::RotationExp(step.head<3>()).toRotationMatrix();
  }
  const Matrix6 by_moved_board = FactorToProduct(cam, world_from_board, rig);
  Eigen::MatrixXd map(num_rest, 6 + 6 + 6 + 2 + 2 + 2);  // eliminated board first, then the global unknowns
  map.setZero();
  std::vector<int> ids;
  map.topLeftCorner<6, 6>() = by_moved_board * motion;
  int used = 6;
  const auto append = [&](int column, const auto& derivative) {
    if (column < 0) return;
    map.block(0, used, 6, derivative.cols()) = derivative;
    for (Index i = 0; i < derivative.cols(); ++i) ids.push_back(column + static_cast<int>(i));
    used += static_cast<int>(derivative.cols());
  };
  append(columns_.camera[c], FactorToProduct(Rigid3(), cam, world_from_board * rig));
  append(columns_.board[b], FactorToProduct(cam * world_from_board, rig, Rigid3()));
  if (moved) {
    append(columns_.time[c], Eigen::MatrixXd(by_moved_board * BoardStepByTime(c, view.frame, trial_, columns_.num_time)));
  }
  int row = 6;
  for (int column : {columns_.warp[b], columns_.stretch[b]}) {
    if (column < 0) continue;
    map.block<2, 2>(row, used).setIdentity();
    for (int i = 0; i < 2; ++i) ids.push_back(column + i);
    used += 2, row += 2;
  }
  const Eigen::MatrixXd rest = partial->rest_rest * map.leftCols(used);
  const Eigen::MatrixXd all = map.leftCols(used).transpose() * rest, lens = partial->lens_rest * map.leftCols(used);
  const Eigen::VectorXd right = map.leftCols(used).transpose() * partial->rest_right;
  system->block_h.middleCols<6>(6 * block) += all.topLeftCorner<6, 6>();
  system->block_g.col(block) += right.head<6>();
  const std::vector<int>& position = position_in_block_[block];
  const Index begin = system->begin[block];
  for (size_t j = 0; j < ids.size(); ++j) {
    const Index column = static_cast<Index>(6 + j);
    system->w.col(begin + position[ids[j]]) += all.block<6, 1>(0, column);
    partial->g[ids[j]] += right[column];
    for (size_t i = j; i < ids.size(); ++i)
      partial->h(std::max(ids[i], ids[j]), std::min(ids[i], ids[j])) += all(static_cast<Index>(6 + i), column);
  }
  const int first = columns_.lens[c];
  for (Index k = 0; k < lens.rows(); ++k) {
    const int id = first + static_cast<int>(k);
    system->w.col(begin + position[id]) += lens.row(k).head<6>().transpose();
    for (size_t j = 0; j < ids.size(); ++j)
      partial->h(std::max(id, ids[j]), std::min(id, ids[j])) += lens(k, static_cast<Index>(6 + j));
  }
}

namespace {

/// Adds (weight * sum of factors * params)^2.
void AddPriorTerm(const Eigen::VectorXd& params, int column, int offset, const std::vector<std::pair<int, double>>& terms,
                  double weight, SchurSystem* system) {
  double residual = 0;
  for (const auto& [index, factor] : terms) residual += weight * factor * params[index];
  system->cost += residual * residual;
  for (const auto& [a, factor_a] : terms) {
    const int i = column + a - offset;
    system->g[i] += weight * factor_a * residual;
    for (const auto& [b, factor_b] : terms) {
      const int j = column + b - offset;
      if (i >= j) system->h(i, j) += weight * weight * factor_a * factor_b;
    }
  }
}

}  // namespace

void RigProblem::AddGivenPrior(SchurSystem* system) const {
  std::vector<int> done;
  for (size_t c = 0; c < std::min(trial_.cameras.size(), options_.lens_prior.size()); ++c) {
    const LensPrior& prior = options_.lens_prior[c];
    const int column = columns_.lens[c], first = columns_.first_param[c];
    if (column < 0 || prior.weight.size() == 0 || std::find(done.begin(), done.end(), column) != done.end()) continue;
    done.push_back(column);
    for (Index i = first; i < prior.weight.size(); ++i) {
      const double difference = trial_.cameras[c].params[i] - prior.mean[i];
      const Index at = column + i - first;
      system->cost += prior.weight[i] * difference * difference;
      system->g[at] += prior.weight[i] * difference;
      system->h(at, at) += prior.weight[i];
    }
  }
}

void RigProblem::AddLensPrior(SchurSystem* system) const {
  std::vector<int> done;
  for (size_t c = 0; c < trial_.cameras.size(); ++c) {
    const geometry::Camera& camera = trial_.cameras[c];
    const int column = columns_.lens[c];
    if (column < 0 || !IsSplined(camera) || std::find(done.begin(), done.end(), column) != done.end()) continue;
    done.push_back(column);
    const int cols = camera.spline.cols, rows = camera.spline.rows;
    const double size = options_.spline_size_weight * camera.fx(), bend = options_.spline_smooth_weight * camera.fx();
    const auto at = [&](int row, int col, int axis) { return 4 + 2 * (row * cols + col) + axis; };
    for (int row = 0; row < rows; ++row) {
      for (int col = 0; col < cols; ++col) {
        for (int axis = 0; axis < 2; ++axis) {
          const int i = at(row, col, axis);
          AddPriorTerm(camera.params, column, 4, {{i, 1}}, size, system);
          if (col > 0 && col + 1 < cols)
            AddPriorTerm(camera.params, column, 4, {{at(row, col - 1, axis), 1}, {i, -2}, {at(row, col + 1, axis), 1}}, bend,
                         system);
          if (row > 0 && row + 1 < rows)
            AddPriorTerm(camera.params, column, 4, {{at(row - 1, col, axis), 1}, {i, -2}, {at(row + 1, col, axis), 1}}, bend,
                         system);
        }
      }
    }
  }
}

}  // namespace mvstudio::calib
