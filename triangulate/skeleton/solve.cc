#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/statistics.h"
#include "geometry/rigid/decompositions.h"
#include "geometry/solve/selected_inverse.h"
#include "triangulate/skeleton/window.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRobustSigmas = 2;  ///< of detections
constexpr double kTermSigmas = 3;    ///< of accelerations and lengths
constexpr double kCarries = 0.2;     ///< least weight of a detection that carries its point: 4 sigmas

/// Cauchy loss of a whitened squared residual and its weight.
double Loss(double squared, double sigmas) { return sigmas * sigmas * std::log1p(squared / (sigmas * sigmas)); }
double Weight(double squared, double sigmas) { return 1 / (1 + squared / (sigmas * sigmas)); }

struct Seen {
  size_t cell, observation;
};
/// Three positions of a joint whose acceleration is sum c_k x_k, in units of its sigma.
struct Triple {
  size_t cell[3];
  double c[3];
};

struct Bone {
  size_t bone, cell_a, cell_b;
};
struct Problem {
  const PreparedRig* rig;
  const Window* window;
  const Terms* terms;
  const std::vector<KnownLength>* known;
  std::vector<int> variable;  // (cells) index of the position among the unknowns, or -1
  int num_positions = 0;
  std::vector<Seen> seen;
  std::vector<Triple> triples;
  std::vector<Bone> bones;
  std::vector<int> length_variable;  // (bones)
  int num_lengths = 0;
  Eigen::Index size() const { return 3 * num_positions + num_lengths; }
};

struct Unknowns {
  std::vector<Eigen::Vector3d> x_in_local;  // (cells)
  std::vector<double> length_m;             // (bones)
};

bool IsOk(const Window& window, size_t f, size_t j) { return window.At(f, j).point.status == Status::kOk; }

/// Nearest frame, from f in steps of `step`, where the joint is known, at most max_fill_frames away.
std::optional<size_t> NearestOk(const Window& window, size_t f, size_t j, int step, int max_frames) {
  for (std::ptrdiff_t k = static_cast<std::ptrdiff_t>(f) + step;
       k >= 0 && k < static_cast<std::ptrdiff_t>(window.frames.size()); k += step) {
    const size_t at = static_cast<size_t>(k);
    if (window.FramesApart(at, f) > max_frames) return std::nullopt;
    if (IsOk(window, at, j)) return at;
  }
  return std::nullopt;
}

/// Known joints start where they are, bridged ones on the line between their neighbours in time.
void AddPositions(Problem* problem, Unknowns* unknowns) {
  const Window& window = *problem->window;
  const Eigen::Vector3d origin = problem->rig->origin_in_world;
  problem->variable.assign(window.cells.size(), -1);
  unknowns->x_in_local.assign(window.cells.size(), Eigen::Vector3d::Zero());
  for (size_t f = 0; f < window.frames.size(); ++f) {
    for (size_t j = 0; j < window.num_joints; ++j) {
      const size_t cell = f * window.num_joints + j;
      if (IsOk(window, f, j)) {
        unknowns->x_in_local[cell] = window.At(f, j).point.x_in_world - origin;
      } else {
        if (!(problem->terms->smoothness > 0)) continue;
        const auto before = NearestOk(window, f, j, -1, problem->terms->max_fill_frames);
        const auto after = NearestOk(window, f, j, 1, problem->terms->max_fill_frames);
        if (!before || !after) continue;
        const double t =
            static_cast<double>(window.frames[f] - window.frames[*before]) / (window.frames[*after] - window.frames[*before]);
        unknowns->x_in_local[cell] =
            (1 - t) * window.At(*before, j).point.x_in_world + t * window.At(*after, j).point.x_in_world - origin;
      }
      problem->variable[cell] = problem->num_positions++;
    }
  }
}

void AddDetections(Problem* problem) {
  for (size_t cell = 0; cell < problem->variable.size(); ++cell) {
    if (problem->variable[cell] < 0) continue;
    const Cell& of = problem->window->cells[cell];
    if (problem->terms->robust) {
      for (size_t i = 0; i < of.observations.size(); ++i) {
        if (of.observations[i].px.allFinite()) problem->seen.push_back({cell, i});
      }
    } else if (of.point.status == Status::kOk) {
      for (const int i : of.point.used) problem->seen.push_back({cell, static_cast<size_t>(i)});
    }
  }
}

void AddAccelerations(Problem* problem) {
  const Window& window = *problem->window;
  for (size_t j = 0; j < window.num_joints; ++j) {
    const double sigma = problem->terms->smoothness * problem->terms->acceleration_m[j];
    if (!(sigma > 0)) continue;
    std::vector<size_t> present;
    for (size_t f = 0; f < window.frames.size(); ++f) {
      if (problem->variable[f * window.num_joints + j] >= 0) present.push_back(f);
    }
    for (size_t k = 2; k < present.size(); ++k) {
      const double t0 = window.frames[present[k - 2]], t1 = window.frames[present[k - 1]], t2 = window.frames[present[k]];
      if (window.FramesApart(present[k - 2], present[k]) > 2 * problem->terms->max_fill_frames + 2) continue;
      const double scale = 2 / (t2 - t0) / sigma;
      Triple triple;
      for (int i = 0; i < 3; ++i) triple.cell[i] = present[k - 2 + static_cast<size_t>(i)] * window.num_joints + j;
      triple.c[0] = scale / (t1 - t0), triple.c[2] = scale / (t2 - t1), triple.c[1] = -triple.c[0] - triple.c[2];
      problem->triples.push_back(triple);
    }
  }
}

void AddBones(const Bones& bones, Problem* problem) {
  problem->length_variable.assign(bones.size(), -1);
  if (!(problem->terms->bone_lengths > 0)) return;
  for (size_t b = 0; b < bones.size(); ++b) {
    if (!((*problem->known)[b].sigma_m > 0)) continue;
    for (size_t f = 0; f < problem->window->frames.size(); ++f) {
      const size_t first = f * problem->window->num_joints;
      const size_t cell_a = first + static_cast<size_t>(bones[b].first), cell_b = first + static_cast<size_t>(bones[b].second);
      if (problem->variable[cell_a] < 0 || problem->variable[cell_b] < 0) continue;
      problem->bones.push_back({b, cell_a, cell_b});
      if (problem->length_variable[b] < 0) problem->length_variable[b] = problem->num_lengths++;
    }
  }
}

/// Triplets of the lower triangle, gradient, and the robust cost.
struct Assembly {
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd gradient;
  double cost = 0;
  bool want_matrix = true;
};

/// A residual of up to seven scalars' columns: positions first, then a length.
template <int kRows>
void AddResidual(const Problem& problem, const std::vector<size_t>& cells, int length,
                 const std::vector<Eigen::Matrix<double, kRows, 3>>& jacobians,
                 const Eigen::Matrix<double, kRows, 1>& by_length, const Eigen::Matrix<double, kRows, 1>& residual,
                 double weight, Assembly* sum) {
  std::vector<Eigen::Index> columns;
  Eigen::Matrix<double, kRows, Eigen::Dynamic> jacobian(kRows, static_cast<Eigen::Index>(3 * cells.size()) + (length >= 0));
  for (size_t i = 0; i < cells.size(); ++i) {
    jacobian.template middleCols<3>(static_cast<Eigen::Index>(3 * i)) = jacobians[i];
    for (int k = 0; k < 3; ++k) columns.push_back(3 * problem.variable[cells[i]] + k);
  }
  if (length >= 0) {
    jacobian.rightCols(1) = by_length;
    columns.push_back(3 * problem.num_positions + length);
  }
  for (size_t a = 0; a < columns.size(); ++a) {
    const Eigen::Index ia = static_cast<Eigen::Index>(a);
    sum->gradient[columns[a]] += weight * jacobian.col(ia).dot(residual);
    for (size_t b = 0; b < columns.size(); ++b) {
      if (columns[b] > columns[a]) continue;
      sum->entries.emplace_back(static_cast<int>(columns[a]), static_cast<int>(columns[b]),
                                weight * jacobian.col(ia).dot(jacobian.col(static_cast<Eigen::Index>(b))));
    }
  }
}

bool AddDetectionTerms(const Problem& problem, const Unknowns& at, Assembly* sum) {
  for (const Seen& seen : problem.seen) {
    const Observation& observation = problem.window->cells[seen.cell].observations[seen.observation];
    const PreparedCamera& camera = problem.rig->cameras[static_cast<size_t>(observation.camera_idx)];
    const auto projection = camera.projector.ProjectWithJacobians(camera.ToCam(at.x_in_local[seen.cell]));
    if (projection.status != Status::kOk) {
      if (problem.terms->robust) continue;  // a detection that cannot be of this point
      return false;
    }
    const Eigen::Vector2d residual = (projection.px - observation.px) / observation.sigma_px;
    const double squared = residual.squaredNorm();
    sum->cost += problem.terms->robust ? Loss(squared, kRobustSigmas) : squared;
    if (!sum->want_matrix) continue;
    const double weight = problem.terms->robust ? Weight(squared, kRobustSigmas) : 1;
    AddResidual<2>(problem, {seen.cell}, -1, {projection.d_px_d_x * camera.cam_from_local_rotation / observation.sigma_px},
                   Eigen::Vector2d::Zero(), residual, weight, sum);
  }
  return true;
}

/// The axes do not mix: three entries of the matrix where a general residual would have nine.
void AddAccelerationTerms(const Problem& problem, const Unknowns& at, Assembly* sum) {
  for (const Triple& triple : problem.triples) {
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) residual += triple.c[k] * at.x_in_local[triple.cell[k]];
    const double squared = residual.squaredNorm(), weight = Weight(squared, kTermSigmas);
    sum->cost += Loss(squared, kTermSigmas);
    if (!sum->want_matrix) continue;
    for (int a = 0; a < 3; ++a) {
      const int row = 3 * problem.variable[triple.cell[a]];
      sum->gradient.segment<3>(row) += weight * triple.c[a] * residual;
      for (int b = 0; b <= a; ++b) {  // cells, and so variables, ascend
        const int col = 3 * problem.variable[triple.cell[b]];
        for (int axis = 0; axis < 3; ++axis)
          sum->entries.emplace_back(row + axis, col + axis, weight * triple.c[a] * triple.c[b]);
      }
    }
  }
}

void AddBoneTerms(const Problem& problem, const Unknowns& at, Assembly* sum) {
  using Row = Eigen::Matrix<double, 1, 3>;
  using Scalar = Eigen::Matrix<double, 1, 1>;
  for (const Bone& bone : problem.bones) {
    const Eigen::Vector3d difference = at.x_in_local[bone.cell_a] - at.x_in_local[bone.cell_b];
    const double length = difference.norm(), sigma = problem.terms->bone_lengths * (*problem.known)[bone.bone].length_m;
    if (!(length > 1e-9)) continue;
    const double residual = (length - at.length_m[bone.bone]) / sigma;
    sum->cost += Loss(residual * residual, kTermSigmas);
    if (!sum->want_matrix) continue;
    const Row by_a = difference.transpose() / length / sigma;
    AddResidual<1>(problem, {bone.cell_a, bone.cell_b}, problem.length_variable[bone.bone], {by_a, -by_a}, Scalar(-1 / sigma),
                   Scalar(residual), Weight(residual * residual, kTermSigmas), sum);
  }
  for (size_t b = 0; b < problem.length_variable.size(); ++b) {
    if (problem.length_variable[b] < 0) continue;
    const KnownLength& known = (*problem.known)[b];
    const double residual = (at.length_m[b] - known.length_m) / known.sigma_m;
    sum->cost += residual * residual;
    if (sum->want_matrix) {
      AddResidual<1>(problem, {}, problem.length_variable[b], {}, Scalar(1 / known.sigma_m), Scalar(residual), 1, sum);
    }
  }
}

Assembly Assemble(const Problem& problem, const Unknowns& at, bool want_matrix) {
  Assembly sum;
  sum.want_matrix = want_matrix;
  sum.gradient = Eigen::VectorXd::Zero(problem.size());
  if (!AddDetectionTerms(problem, at, &sum)) {
    sum.cost = kInfinity;
    return sum;
  }
  AddAccelerationTerms(problem, at, &sum);
  AddBoneTerms(problem, at, &sum);
  for (int row = 0; want_matrix && row < 3 * problem.num_positions; row += 3) {  // every point's own block has its entries
    for (const auto& [a, b] : {std::pair<int, int>{1, 0}, {2, 0}, {2, 1}}) sum.entries.emplace_back(row + a, row + b, 0.0);
  }
  return sum;
}

Eigen::SparseMatrix<double> ToMatrix(const Problem& problem, const Assembly& assembly) {
  Eigen::SparseMatrix<double> matrix(problem.size(), problem.size());
  matrix.setFromTriplets(assembly.entries.begin(), assembly.entries.end());
  return matrix;
}

Unknowns Moved(const Problem& problem, const Unknowns& from, const Eigen::VectorXd& step, double factor) {
  Unknowns to = from;
  for (size_t cell = 0; cell < problem.variable.size(); ++cell) {
    if (problem.variable[cell] >= 0) to.x_in_local[cell] += factor * step.segment<3>(3 * problem.variable[cell]);
  }
  for (size_t b = 0; b < problem.length_variable.size(); ++b) {
    if (problem.length_variable[b] >= 0)
      to.length_m[b] += factor * step[3 * problem.num_positions + problem.length_variable[b]];
  }
  return to;
}

/// Gauss-Newton on the reweighted problem, steps halved until the cost falls. False when the system is singular.
bool Minimise(const Problem& problem, int max_iterations, Unknowns* at) {
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Assembly here = Assemble(problem, *at, true);
    if (!std::isfinite(here.cost)) return false;
    const Eigen::SparseMatrix<double> matrix = ToMatrix(problem, here);
    if (iteration == 0) factor.analyzePattern(matrix);
    factor.factorize(matrix);
    if (factor.info() != Eigen::Success) return false;
    const Eigen::VectorXd step = -factor.solve(here.gradient);
    if (!step.allFinite()) return false;
    double fraction = 1;
    Unknowns next = Moved(problem, *at, step, fraction);
    double cost = Assemble(problem, next, false).cost;
    for (int halving = 0; halving < 6 && !(cost <= here.cost); ++halving) {
      fraction /= 2;
      next = Moved(problem, *at, step, fraction);
      cost = Assemble(problem, next, false).cost;
    }
    if (!(cost <= here.cost)) return true;  // nothing left to gain
    *at = std::move(next);
    if (here.cost - cost < 1e-6 * here.cost) return true;
  }
  return true;
}

/// Fit of a point to its detections.
void Describe(const Problem& problem, size_t cell, const Eigen::Vector3d& x_in_local, Point* point) {
  const Cell& of = problem.window->cells[cell];
  if (problem.terms->robust) point->used.clear();
  double sum_px = 0;
  point->chi_squared = 0;
  for (size_t i = 0; i < of.observations.size(); ++i) {
    const Observation& seen = of.observations[i];
    const PreparedCamera& camera = problem.rig->cameras[static_cast<size_t>(seen.camera_idx)];
    const bool used = std::binary_search(of.point.used.begin(), of.point.used.end(), static_cast<int>(i));
    const auto projection = camera.projector.Project(camera.ToCam(x_in_local));
    if (projection.status != Status::kOk || (!problem.terms->robust && !used)) continue;
    const double squared_px = (projection.px - seen.px).squaredNorm(), squared = squared_px / (seen.sigma_px * seen.sigma_px);
    if (problem.terms->robust && !(Weight(squared, kRobustSigmas) >= kCarries)) continue;
    if (problem.terms->robust) point->used.push_back(static_cast<int>(i));
    sum_px += squared_px, point->chi_squared += squared;
  }
  point->rms_px = point->used.empty() ? 0 : std::sqrt(sum_px / static_cast<double>(point->used.size()));
}

double LargestSigma(const Eigen::Matrix3d& covariance) { return std::sqrt(geometry::SymmetricEigenvalues(covariance)[2]); }

Eigen::Matrix3d CovarianceAt(const Problem& problem, size_t cell, const geometry::SelectedInverse& inverse) {
  const Eigen::Index first = 3 * problem.variable[cell];
  Eigen::Matrix3d covariance;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) covariance(a, b) = inverse(first + a, first + b);
  }
  return covariance;
}

/// Points with their covariances; bridged ones only where they are determined well enough.
std::vector<Point> ToPoints(const Problem& problem, const Unknowns& at, const geometry::SelectedInverse& inverse) {
  const Window& window = *problem.window;
  const double shared = problem.terms->shared_error;
  std::vector<Point> points = PointsOf(window);
  for (size_t j = 0; j < window.num_joints; ++j) {
    std::vector<double> sigmas, ratios;
    for (const bool bridged : {false, true}) {
      const double limit = problem.terms->max_fill_sigmas * UpperMedian(sigmas), ratio = UpperMedian(ratios);
      for (size_t f = 0; f < window.frames.size(); ++f) {
        const size_t cell = f * window.num_joints + j;
        if (problem.variable[cell] < 0 || IsOk(window, f, j) == bridged) continue;
        const Eigen::Matrix3d covariance = CovarianceAt(problem, cell, inverse);
        const double sigma = LargestSigma(covariance);
        if (bridged && !(sigma <= limit)) continue;
        Point& point = points[cell];
        const Eigen::Matrix3d single = point.covariance - point.calibration_covariance;
        if (!bridged) sigmas.push_back(sigma), ratios.push_back(single.trace() / covariance.trace());
        if (bridged) {
          point.used.clear();
          const Point& seen =  // the last instant at which it was, which is there
              window.At(*NearestOk(window, f, j, -1, problem.terms->max_fill_frames), j).point;
          point.calibration_covariance = seen.calibration_covariance;
          point.num_unknown_cameras = seen.num_unknown_cameras;
        }
        point.status = Status::kOk;
        point.x_in_world = problem.rig->origin_in_world + at.x_in_local[cell];
        point.covariance = (1 - shared) * covariance + shared * (bridged ? Eigen::Matrix3d(ratio * covariance) : single) +
                           point.calibration_covariance;
        Describe(problem, cell, at.x_in_local[cell], &point);
      }
    }
  }
  return points;
}

}  // namespace

WindowSolution SolveWindow(const PreparedRig& rig, const Window& window, const Bones& bones,
                           const std::vector<KnownLength>& known, const Terms& terms, int max_iterations) {
  WindowSolution solution;
  for (const Cell& cell : window.cells) solution.points.push_back(cell.point);
  solution.lengths = known;
  for (KnownLength& each : solution.lengths) each.sigma_m = 0;
  if (!terms.Any()) return solution;
  Problem problem{&rig, &window, &terms, &known, {}, 0, {}, {}, {}, {}, 0};
  Unknowns at;
  AddPositions(&problem, &at);
  if (problem.num_positions == 0) return solution;
  AddDetections(&problem);
  if (terms.smoothness > 0) AddAccelerations(&problem);
  AddBones(bones, &problem);
  for (const KnownLength& each : known) at.length_m.push_back(each.length_m);
  if (!Minimise(problem, max_iterations, &at)) return solution;
  const geometry::SelectedInverse inverse(ToMatrix(problem, Assemble(problem, at, true)));
  if (!inverse.ok()) return solution;
  solution.points = ToPoints(problem, at, inverse);
  for (size_t b = 0; b < bones.size(); ++b) {
    if (problem.length_variable[b] < 0) continue;
    const Eigen::Index i = 3 * problem.num_positions + problem.length_variable[b];
    solution.lengths[b] = {at.length_m[b], std::sqrt(inverse(i, i))};
  }
  return solution;
}

}  // namespace mvstudio::triangulate::internal
