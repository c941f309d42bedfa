#include <suitesparse/cholmod.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <stdexcept>
#include <string>

#include "bench/calibration.h"
#include "bench/quality.h"
#include "calib/bundle/mrcal_problem.h"
#include "core/error.h"

namespace mvstudio::bench {
namespace {

using calib::internal::MrcalProblem;
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Matrix3R = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Matrix36R = Eigen::Matrix<double, 3, 6, Eigen::RowMajor>;

/// J^T at the solution, and its factor as mrcal's python module keeps it.
class Factorization {
 public:
  explicit Factorization(const MrcalProblem& problem) {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_AUTO;
    const int states = problem.num_states(), measurements = problem.num_measurements();
    const int observations = static_cast<int>(problem.observations.size()), poses = static_cast<int>(problem.extrinsics.size());
    const int frames = static_cast<int>(problem.frames.size());
    const int nonzero =
        _mrcal_num_j_nonzero(observations, 0, problem.width, problem.height, problem.num_lenses(), poses, frames, 0, 0,
                             problem.observations.data(), nullptr, problem.selections, &problem.lens);
    cholmod_sparse* jt = cholmod_allocate_sparse(states, measurements, nonzero, 1, 1, 0, CHOLMOD_REAL, &common_);
    std::vector<double> packed(states), x(measurements);
    const mrcal_problem_constants_t ranges{1e-6, 1e6};
    const bool ok = mrcal_optimizer_callback(
        packed.data(), states * static_cast<int>(sizeof(double)), x.data(), measurements * static_cast<int>(sizeof(double)), jt,
        problem.intrinsics.data(), problem.extrinsics.data(), problem.frames.data(), nullptr, &problem.warp,
        problem.num_lenses(), poses, frames, 0, 0, problem.observations.data(), nullptr, observations, 0, problem.pool.data(),
        &problem.lens, problem.image_sizes.data(), problem.selections, &ranges, problem.spacing_m, problem.width,
        problem.height, false);
    if (ok) factor_ = cholmod_analyze(jt, &common_);
    if (factor_) cholmod_factorize(jt, factor_, &common_);
    cholmod_free_sparse(&jt, &common_);
    if (!factor_ || common_.status != CHOLMOD_OK) throw Error("mrcal's Jacobian could not be factored");
  }
  ~Factorization() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Factorization(const Factorization&) = delete;
  Factorization& operator=(const Factorization&) = delete;

  /// (J^T J)^-1 times the columns.
  Eigen::MatrixXd Solve(Eigen::MatrixXd columns) {
    cholmod_dense right{};
    right.nrow = columns.rows(), right.ncol = columns.cols(), right.d = columns.rows(), right.nzmax = columns.size();
    right.x = columns.data(), right.xtype = CHOLMOD_REAL, right.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* solution = cholmod_solve(CHOLMOD_A, factor_, &right, &common_);
    if (!solution) throw Error("CHOLMOD did not solve");
    columns = Eigen::Map<const Eigen::MatrixXd>(static_cast<double*>(solution->x), columns.rows(), columns.cols());
    cholmod_free_dense(&solution, &common_);
    return columns;
  }

 private:
  cholmod_common common_{};
  cholmod_factor* factor_ = nullptr;
};

/// d pixel / d state (2, states), full units, of the point that is carried through the mean of all boards' frames.
RowMatrix PixelByState(const MrcalProblem& problem, int camera_idx, const Eigen::Vector3d& x_in_cam) {
  const int poses = static_cast<int>(problem.extrinsics.size()), frames = static_cast<int>(problem.frames.size());
  const int observations = static_cast<int>(problem.observations.size());
  const int lens = problem.lens_of_camera[camera_idx], pose = problem.pose_of_camera[camera_idx];
  RowMatrix result = RowMatrix::Zero(2, problem.num_states());
  mrcal_point3_t point{};
  for (int i = 0; i < 3; ++i) point.xyz[i] = x_in_cam[i];
  mrcal_point2_t px;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_x;
  RowMatrix d_lens(2, problem.num_lens_params);
  mrcal_project(&px, reinterpret_cast<mrcal_point3_t*>(d_x.data()), d_lens.data(), &point, 1, &problem.lens,
                problem.intrinsics.data() + static_cast<size_t>(lens) * problem.num_lens_params);
  const int lens_at = mrcal_state_index_intrinsics(lens, problem.num_lenses(), poses, frames, 0, 0, observations,
                                                   problem.selections, &problem.lens);
  result.middleCols(lens_at, problem.num_lens_params) = d_lens;
  Eigen::Vector3d x_in_reference = x_in_cam;
  Matrix3R d_reference = Matrix3R::Identity();
  if (pose >= 0) {
    const double* rt = problem.extrinsics[pose].r.xyz;
    mrcal_transform_point_rt_inverted(x_in_reference.data(), nullptr, nullptr, rt, x_in_cam.data());
    Eigen::Vector3d again;
    Matrix36R d_pose;
    mrcal_transform_point_rt(again.data(), d_pose.data(), d_reference.data(), rt, x_in_reference.data());
    const int pose_at = mrcal_state_index_extrinsics(pose, problem.num_lenses(), poses, frames, 0, 0, observations,
                                                     problem.selections, &problem.lens);
    result.middleCols<6>(pose_at) = d_x * d_pose;
  }
  const Eigen::Matrix<double, 2, 3> d_px_reference = d_x * d_reference;
  const int frames_at =
      mrcal_state_index_frames(0, problem.num_lenses(), poses, frames, 0, 0, observations, problem.selections, &problem.lens);
  for (int f = 0; f < frames; ++f) {
    Eigen::Vector3d x_in_board, again;
    Matrix36R d_frame;
    const double* rt = problem.frames[f].r.xyz;
    mrcal_transform_point_rt_inverted(x_in_board.data(), nullptr, nullptr, rt, x_in_reference.data());
    mrcal_transform_point_rt(again.data(), d_frame.data(), nullptr, rt, x_in_board.data());
    result.middleCols<6>(frames_at + 6 * f) = d_px_reference * d_frame / frames;
  }
  return result;
}

}  // namespace

Solution SolveByMrcal(const RigScene& scene, const calib::BundleOptions& options) {
  Solution solution{{}, scene.start, scene.views, 0};
  MrcalProblem problem = calib::internal::MakeMrcalProblem(solution.views, solution.state, {{scene.board}, options, false});
  std::string said;
  const Stopwatch watch;
  if (!calib::internal::Optimize(&problem, &said)) throw Error("mrcal gave up: " + said);
  solution.seconds = watch.Seconds();
  calib::internal::ToState(problem, options.gauge, &solution.views, &solution.state);
  return solution;
}

UncertaintyMap MapByMrcal(const Solution& solution, const calib::Board& board, const calib::BundleOptions& options,
                          int camera_idx, int cols, int rows, double distance_m, double sigma_px) {
  const MrcalProblem problem = calib::internal::MakeMrcalProblem(solution.views, solution.state, {{board}, options, false});
  const geometry::Camera& camera = solution.state.cameras[camera_idx];
  const std::vector<Eigen::Vector2d> pixels = MapPixels(camera, cols, rows);
  const int poses = static_cast<int>(problem.extrinsics.size()), frames = static_cast<int>(problem.frames.size());
  const Stopwatch watch;
  Factorization factorization(problem);
  RowMatrix d_packed(2 * pixels.size(), problem.num_states());
  const geometry::Projector projector(camera);
  for (size_t i = 0; i < pixels.size(); ++i) {
    d_packed.middleRows<2>(2 * static_cast<Eigen::Index>(i)) =
        PixelByState(problem, camera_idx, distance_m * projector.Unproject(pixels[i]).ray_in_cam);
  }
  for (Eigen::Index row = 0; row < d_packed.rows();
       ++row) {  // d / d packed = d / d state * scale, which is what unpacking does
    mrcal_unpack_solver_state_vector(d_packed.row(row).data(), problem.num_lenses(), poses, frames, 0, 0, problem.selections,
                                     &problem.lens);
  }
  const Eigen::MatrixXd solved = factorization.Solve(d_packed.transpose());
  UncertaintyMap map;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto at = 2 * static_cast<Eigen::Index>(i);
    const Eigen::Matrix2d covariance = sigma_px * sigma_px * d_packed.middleRows<2>(at) * solved.middleCols<2>(at);
    map.sigma_px.push_back(std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues()[1]));
  }
  map.seconds = watch.Seconds();
  return map;
}

}  // namespace mvstudio::bench
