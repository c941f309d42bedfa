#include "calib/view.h"

#include <ceres/jet.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "geometry/camera_model.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;
using Matrix23 = Eigen::Matrix<double, 2, 3>;

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// Projection with derivatives with respect to P parameters and the point.
template <int P>
bool ProjectJet(LensModel model, const double* params, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* px,
                Eigen::Ref<Eigen::MatrixXd> d_params, Matrix23* d_x) {
  using Jet = ceres::Jet<double, P + 3>;
  Jet p[P];
  for (int i = 0; i < P; ++i) p[i] = Jet(params[i], i);
  Eigen::Matrix<Jet, 3, 1> x;
  for (int i = 0; i < 3; ++i) x[i] = Jet(x_in_cam[i], P + i);
  Eigen::Matrix<Jet, 2, 1> out;
  if (!geometry::ProjectByFormula(model, p, x, &out)) return false;
  for (int row = 0; row < 2; ++row) {
    (*px)[row] = out[row].a;
    d_params.row(row) = out[row].v.template head<P>().transpose();
    d_x->row(row) = out[row].v.template tail<3>().transpose();
  }
  return px->allFinite();
}

using ProjectFunction = bool (*)(LensModel, const double*, const Eigen::Vector3d&, Eigen::Vector2d*,
                                 Eigen::Ref<Eigen::MatrixXd>, Matrix23*);

ProjectFunction ProjectFunctionFor(int num_params) {
  switch (num_params) {
    case 4:
      return &ProjectJet<4>;
    case 5:
      return &ProjectJet<5>;
    case 6:
      return &ProjectJet<6>;
    case 8:
      return &ProjectJet<8>;
    case 9:
      return &ProjectJet<9>;
    case 12:
      return &ProjectJet<12>;
    default:
      break;
  }
  MVS_CHECK(false, "no lens model has " << num_params << " parameters");
  return nullptr;
}

}  // namespace

View MakeView(const Board& board, const Detection& detection, const std::vector<int64_t>& frames) {
  MVS_CHECK(detection.points_px.cols() == detection.num_corners(), "points and corner ids differ in number");
  const auto frame = std::lower_bound(frames.begin(), frames.end(), detection.frame_idx);
  MVS_CHECK(frame != frames.end() && *frame == detection.frame_idx, "frame " << detection.frame_idx << " is not listed");
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  View view;
  view.camera_idx = detection.camera_idx;
  view.frame = static_cast<int>(frame - frames.begin());
  view.corner_ids = detection.corner_ids;
  view.x_in_board.resize(3, detection.num_corners());
  for (int i = 0; i < detection.num_corners(); ++i) {
    const int id = detection.corner_ids[i];
    MVS_CHECK(id >= 0 && id < board.num_corners(), "corner " << id << " is not on the board");
    view.x_in_board.col(i) = corners.col(id);
  }
  view.px = detection.points_px;
  view.weights = Eigen::VectorXd::Constant(detection.num_corners(), 1 / (detection.sigma_px * detection.sigma_px));
  return view;
}

std::vector<View> MakeViews(const Board& board, const std::vector<Detection>& detections, std::vector<int64_t>* frames) {
  frames->clear();
  for (const Detection& detection : detections) frames->push_back(detection.frame_idx);
  std::sort(frames->begin(), frames->end());
  frames->erase(std::unique(frames->begin(), frames->end()), frames->end());
  std::vector<View> views;
  for (const Detection& detection : detections) views.push_back(MakeView(board, detection, *frames));
  return views;
}

View HalfOf(const View& view, int first) {
  View half = view;
  Eigen::Index n = 0;
  for (Eigen::Index i = first; i < view.size(); i += 2, ++n) {
    half.corner_ids[n] = view.corner_ids[i];
    half.x_in_board.col(n) = view.x_in_board.col(i);
    half.px.col(n) = view.px.col(i);
    half.weights[n] = view.weights[i];
  }
  half.corner_ids.resize(n);
  half.x_in_board.conservativeResize(3, n);
  half.px.conservativeResize(2, n);
  half.weights.conservativeResize(n);
  return half;
}

std::optional<ViewLinearization> LinearizeView(const View& view, const geometry::Camera& camera,
                                               const geometry::Rigid3& cam_from_world, const geometry::Rigid3& world_from_board,
                                               bool weighted) {
  const Eigen::Index n = view.size(), num_params = camera.params.size();
  const ProjectFunction project = ProjectFunctionFor(static_cast<int>(num_params));
  const Eigen::Matrix3d cam_r_world = cam_from_world.rotation.toRotationMatrix();
  const Eigen::Matrix3d world_r_board = world_from_board.rotation.toRotationMatrix();
  ViewLinearization out{Eigen::VectorXd::Zero(2 * n), Eigen::MatrixXd::Zero(2 * n, num_params), Eigen::MatrixXd::Zero(2 * n, 6),
                        Eigen::MatrixXd::Zero(2 * n, 6)};
  Eigen::MatrixXd d_params(2, num_params);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (weighted && view.weights[i] <= 0) continue;
    const Eigen::Vector3d turned_board = world_r_board * view.x_in_board.col(i);
    const Eigen::Vector3d turned_world = cam_r_world * (turned_board + world_from_board.translation);
    Eigen::Vector2d px;
    Matrix23 d_x;
    if (!project(camera.model, camera.params.data(), turned_world + cam_from_world.translation, &px, d_params, &d_x))
      return std::nullopt;
    const double scale = weighted ? std::sqrt(view.weights[i]) : 1;
    d_x *= scale;
    out.residuals.segment<2>(2 * i) = scale * (px - view.px.col(i));
    out.d_params.middleRows(2 * i, 2) = scale * d_params;
    out.d_cam.block<2, 3>(2 * i, 0) = -d_x * Cross(turned_world);
    out.d_cam.block<2, 3>(2 * i, 3) = d_x;
    const Matrix23 d_world = d_x * cam_r_world;
    out.d_board.block<2, 3>(2 * i, 0) = -d_world * Cross(turned_board);
    out.d_board.block<2, 3>(2 * i, 3) = d_world;
  }
  return out;
}

std::optional<Eigen::Matrix2Xd> ResidualsOf(const View& view, const geometry::Camera& camera,
                                            const geometry::Rigid3& cam_from_board) {
  Eigen::Matrix2Xd residuals(2, view.size());
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    const Eigen::Vector3d x_in_cam = cam_from_board * Eigen::Vector3d(view.x_in_board.col(i));
    Eigen::Vector2d px;
    if (geometry::ProjectByFormula<double>(camera.model, camera.params.data(), x_in_cam, &px) && px.allFinite()) {
      residuals.col(i) = px - view.px.col(i);
    } else if (view.weights[i] > 0) {
      return std::nullopt;
    } else {
      residuals.col(i).setConstant(std::numeric_limits<double>::infinity());
    }
  }
  return residuals;
}

}  // namespace mvstudio::calib
