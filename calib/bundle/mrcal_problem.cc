#include "calib/bundle/mrcal_problem.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "core/check.h"

namespace mvstudio::calib::internal {
namespace {

using geometry::Camera;
using geometry::LensModel;
using geometry::Rigid3;

bool InUse(const View& view) { return (view.weights.array() > 0).any(); }

mrcal_lensmodel_t ToMrcal(const Camera& camera) {
  mrcal_lensmodel_t lens{};
  switch (camera.model) {
    case LensModel::kPinhole:
      lens.type = MRCAL_LENSMODEL_PINHOLE;
      break;
    case LensModel::kBrown4:
      lens.type = MRCAL_LENSMODEL_OPENCV4;
      break;
    case LensModel::kBrown5:
      lens.type = MRCAL_LENSMODEL_OPENCV5;
      break;
    case LensModel::kRational8:
      lens.type = MRCAL_LENSMODEL_OPENCV8;
      break;
    case LensModel::kThinPrism12:
      lens.type = MRCAL_LENSMODEL_OPENCV12;
      break;
    case LensModel::kSplined:
      lens.type = MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC;
      lens.LENSMODEL_SPLINED_STEREOGRAPHIC__config = {
          static_cast<uint16_t>(camera.spline.order), static_cast<uint16_t>(camera.spline.cols),
          static_cast<uint16_t>(camera.spline.rows), static_cast<uint16_t>(camera.spline.fov_x_deg)};
      break;
    default:
      MVS_CHECK(false, "mrcal has no lens model " << geometry::ToString(camera.model));
  }
  return lens;
}

mrcal_pose_t ToMrcal(const Rigid3& pose) {
  const Eigen::Vector3d r = geometry::RotationLog(pose.rotation);
  mrcal_pose_t result{};
  for (int i = 0; i < 3; ++i) result.r.xyz[i] = r[i], result.t.xyz[i] = pose.translation[i];
  return result;
}

Rigid3 FromMrcal(const mrcal_pose_t& pose) {
  Rigid3 result;
  result.rotation = geometry::RotationExp(Eigen::Vector3d(pose.r.x, pose.r.y, pose.r.z));
  result.translation = Eigen::Vector3d(pose.t.x, pose.t.y, pose.t.z);
  return result;
}

/// Views with corners, sorted by frame, then camera.
std::vector<int> SortedViews(const std::vector<View>& views) {
  std::vector<int> order;
  for (size_t v = 0; v < views.size(); ++v) {
    if (InUse(views[v])) order.push_back(static_cast<int>(v));
  }
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return std::pair(views[a].frame, views[a].camera_idx) < std::pair(views[b].frame, views[b].camera_idx);
  });
  return order;
}

/// The camera whose frame becomes mrcal's reference: the one that the gauge fixes where it is in use.
int ReferenceCamera(const std::vector<View>& views, const Gauge& gauge) {
  int first = -1;
  for (const View& view : views) {
    if (!InUse(view)) continue;
    if (gauge.kind == Gauge::Kind::kCamera && view.camera_idx == gauge.index) return gauge.index;
    if (first < 0 || view.camera_idx < first) first = view.camera_idx;
  }
  return first;
}

void AddCameras(const std::vector<View>& views, const RigState& state, MrcalProblem* problem) {
  std::vector<bool> used(state.cameras.size(), false);
  for (const View& view : views) used[view.camera_idx] = used[view.camera_idx] || InUse(view);
  problem->lens_of_camera.assign(state.cameras.size(), -1);
  problem->pose_of_camera.assign(state.cameras.size(), -1);
  const Rigid3 world_from_reference = geometry::Inverse(state.cam_from_world[problem->reference]);
  std::map<int, int> of_group;
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    if (!used[c]) continue;
    const Camera& camera = state.cameras[c];
    const int group = state.lens_group.empty() ? static_cast<int>(c) : state.lens_group[c];
    const auto [entry, is_new] = of_group.insert({group, static_cast<int>(of_group.size())});
    problem->lens_of_camera[c] = entry->second;
    if (is_new) {
      problem->intrinsics.insert(problem->intrinsics.end(), camera.params.begin(), camera.params.end());
      problem->image_sizes.insert(problem->image_sizes.end(), {camera.width_px, camera.height_px});
    }
    if (static_cast<int>(c) == problem->reference) continue;
    problem->pose_of_camera[c] = static_cast<int>(problem->extrinsics.size());
    problem->extrinsics.push_back(ToMrcal(state.cam_from_world[c] * world_from_reference));
  }
  problem->lens = ToMrcal(state.cameras[problem->reference]);
  problem->num_lens_params = mrcal_lensmodel_num_params(&problem->lens);
}

void AddObservation(const View& view, int index, const RigState& state, MrcalProblem* problem) {
  int& frame = problem->frame_of[view.frame];
  if (frame < 0) {
    frame = static_cast<int>(problem->frames.size());
    problem->frames.push_back(ToMrcal(state.cam_from_world[problem->reference] * state.world_from_board[view.frame]));
  }
  mrcal_observation_board_t observation{};
  observation.icam.intrinsics = problem->lens_of_camera[view.camera_idx];
  observation.icam.extrinsics = problem->pose_of_camera[view.camera_idx];
  observation.iframe = frame;
  problem->observations.push_back(observation);
  problem->view_of_observation.push_back(index);
  mrcal_point3_t none{};
  none.z = -1;
  const size_t begin = problem->pool.size();
  problem->pool.resize(begin + static_cast<size_t>(problem->width) * problem->height, none);
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    mrcal_point3_t& corner = problem->pool[begin + view.corner_ids[i]];
    corner.x = view.px(0, i), corner.y = view.px(1, i);
    if (view.weights[i] > 0) corner.z = std::sqrt(view.weights[i]);
  }
}

mrcal_problem_selections_t Selections(const MrcalOptions& options, LensModel model) {
  const bool splined = model == LensModel::kSplined;
  mrcal_problem_selections_t selections{};
  selections.do_optimize_intrinsics_core = options.bundle.refine_intrinsics && !splined;
  selections.do_optimize_intrinsics_distortions = options.bundle.refine_intrinsics;
  selections.do_optimize_extrinsics = options.bundle.refine_cameras;
  selections.do_optimize_frames = true;
  selections.do_optimize_calobject_warp = options.bundle.refine_warp;
  selections.do_apply_regularization = options.regularize || splined;
  selections.do_apply_outlier_rejection = options.bundle.reject_outliers;
  return selections;
}

}  // namespace

int MrcalProblem::num_states() const {
  return mrcal_num_states(num_lenses(), static_cast<int>(extrinsics.size()), static_cast<int>(frames.size()), 0, 0,
                          static_cast<int>(observations.size()), selections, &lens);
}

int MrcalProblem::num_measurements() const {
  return mrcal_num_measurements(static_cast<int>(observations.size()), 0, width, height, num_lenses(),
                                static_cast<int>(extrinsics.size()), static_cast<int>(frames.size()), 0, 0, selections, &lens);
}

MrcalProblem MakeMrcalProblem(const std::vector<View>& views, const RigState& state, const MrcalOptions& options) {
  MrcalProblem problem;
  const std::vector<int> order = SortedViews(views);
  MVS_CHECK(!order.empty(), "no corners");
  problem.board = views[order[0]].board;
  const Board& board = options.boards.at(problem.board);
  problem.width = board.cols, problem.height = board.rows, problem.spacing_m = board.square_m;
  problem.warp.x2 = state.board_warp_m.at(problem.board).x();
  problem.warp.y2 = state.board_warp_m.at(problem.board).y();
  problem.reference = ReferenceCamera(views, options.bundle.gauge);
  problem.selections = Selections(options, state.cameras[problem.reference].model);
  AddCameras(views, state, &problem);
  problem.frame_of.assign(state.world_from_board.size(), -1);
  for (int v : order) AddObservation(views[v], v, state, &problem);
  return problem;
}

void ToState(const MrcalProblem& problem, const Gauge& gauge, std::vector<View>* views, RigState* state) {
  Rigid3 reference_from_world = state->cam_from_world[problem.reference];
  const bool by_board = gauge.kind == Gauge::Kind::kBoard && problem.frame_of.at(gauge.index) >= 0;
  if (by_board) {
    reference_from_world =
        FromMrcal(problem.frames[problem.frame_of[gauge.index]]) * geometry::Inverse(state->world_from_board[gauge.index]);
  }
  const Rigid3 world_from_reference = geometry::Inverse(reference_from_world);
  for (size_t c = 0; c < state->cameras.size(); ++c) {
    if (problem.lens_of_camera[c] < 0) continue;
    const double* lens = problem.intrinsics.data() + static_cast<size_t>(problem.lens_of_camera[c]) * problem.num_lens_params;
    state->cameras[c].params = Eigen::Map<const Eigen::VectorXd>(lens, problem.num_lens_params);
    if (problem.pose_of_camera[c] >= 0) {
      state->cam_from_world[c] = FromMrcal(problem.extrinsics[problem.pose_of_camera[c]]) * reference_from_world;
    } else {
      state->cam_from_world[c] = reference_from_world;
    }
  }
  for (size_t f = 0; f < problem.frame_of.size(); ++f) {
    const bool fixed = by_board && gauge.index == static_cast<int>(f);
    if (problem.frame_of[f] >= 0 && !fixed)
      state->world_from_board[f] = world_from_reference * FromMrcal(problem.frames[problem.frame_of[f]]);
  }
  state->board_warp_m.at(problem.board) = Eigen::Vector2d(problem.warp.x2, problem.warp.y2);
  const size_t corners = static_cast<size_t>(problem.width) * problem.height;
  for (size_t o = 0; o < problem.observations.size(); ++o) {
    View& view = (*views)[problem.view_of_observation[o]];
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      if (problem.pool[o * corners + view.corner_ids[i]].z < 0) view.weights[i] = 0;
    }
  }
}

}  // namespace mvstudio::calib::internal
