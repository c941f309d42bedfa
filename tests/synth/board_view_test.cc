#include "synth/board_view.h"

#include <Eigen/Dense>
#include <cmath>

#include "synth/motion.h"
#include "synth/studio.h"
#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

/// Saddle of the quadratic that fits the grey values around `at` best; nothing when there is no saddle within 2 px.
bool FindSaddle(const Image& image, Eigen::Vector2d at, Eigen::Vector2d* saddle) {
  constexpr int kRadius = 4;
  const Eigen::Vector2d start = at;
  for (int iteration = 0; iteration < 12; ++iteration) {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    const int cx = static_cast<int>(std::lround(at[0])), cy = static_cast<int>(std::lround(at[1]));
    if (cx < kRadius || cy < kRadius || cx >= image.width - kRadius || cy >= image.height - kRadius) return false;
    for (int y = cy - kRadius; y <= cy + kRadius; ++y) {
      for (int x = cx - kRadius; x <= cx + kRadius; ++x) {
        const double u = x - at[0], v = y - at[1], weight = std::exp(-(u * u + v * v) / (2 * 1.4 * 1.4));
        Eigen::Matrix<double, 6, 1> row;
        row << 1, u, v, u * u, u * v, v * v;
        normal += weight * row * row.transpose();
        right += weight * *image.Pixel(x, y) * row;
      }
    }
    const Eigen::Matrix<double, 6, 1> q = normal.ldlt().solve(right);
    Eigen::Matrix2d hessian;
    hessian << 2 * q[3], q[4], q[4], 2 * q[5];
    if (!(hessian.determinant() < 0)) return false;
    const Eigen::Vector2d step = hessian.inverse() * -q.segment<2>(1);
    if (!(step.norm() < 2)) return false;
    at += step;
    if (step.norm() < 1e-4) break;
  }
  *saddle = at;
  return (at - start).norm() < 2;
}

struct Errors {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double rms = 0;
  int count = 0;
};

/// Rendered corners minus projected corners, over all cameras and some poses in which the board is seen well.
Errors CornerErrors(const std::string& lens) {
  SynthOptions options;
  options.lens = lens;
  const geometry::Rig rig = MakeStudio(options, 2);
  const calib::Board board = calib::ParseBoard("charuco:7x5:140mm:105mm");
  const BoardPainter painter(board);
  const Eigen::Matrix3Xd corners = calib::CornersInBoard(board);
  Errors errors;
  for (size_t c = 0; c < rig.cameras.size(); c += 3) {
    const geometry::RigCamera& camera = rig.cameras[c];
    const LensRays rays(camera);
    const geometry::Projector projector(camera.camera);
    for (int f = 1; f < 60; f += 4) {
      const geometry::Rigid3 pose = BoardPose(board, f, 60, 2);
      const Eigen::Vector3d view = (pose * Eigen::Vector3d(corners.col(0)) - camera.CenterInWorld()).normalized();
      if (view.dot(pose.rotation * Eigen::Vector3d::UnitZ()) < 0.7) continue;
      Image image(640, 480, 3, 110), grey(640, 480, 1);
      painter.Draw(pose, camera, rays, 5, &image);
      for (size_t i = 0; i < grey.pixels.size(); ++i) grey.pixels[i] = image.pixels[3 * i];
      for (int i = 0; i < corners.cols(); ++i) {
        const geometry::Projection truth = projector.Project(camera.cam_from_world * (pose * Eigen::Vector3d(corners.col(i))));
        Eigen::Vector2d found;
        if (truth.status != Status::kOk || !geometry::InImage(camera.camera, truth.px) || !FindSaddle(grey, truth.px, &found))
          continue;
        errors.mean += found - truth.px;
        errors.rms += (found - truth.px).squaredNorm();
        ++errors.count;
      }
    }
  }
  errors.mean /= errors.count;
  errors.rms = std::sqrt(errors.rms / errors.count);
  return errors;
}

TEST(BoardPainter, CornersLieWhereTheLensPutsThem) {
  for (const char* lens : {"brown5", "kannala4"}) {
    const Errors errors = CornerErrors(lens);
    EXPECT_GT(errors.count, 150);
    EXPECT_LT(errors.mean.cwiseAbs().maxCoeff(), 0.02) << lens << ": " << errors.mean.transpose();
    EXPECT_LT(errors.rms, 0.08) << lens;
  }
}

TEST(BoardPainter, TheBackIsPlainAndTheBoardBehindTheCameraUnseen) {
  SynthOptions options;
  const geometry::RigCamera camera = MakeStudio(options, 2).cameras[0];
  const LensRays rays(camera);
  const calib::Board board = calib::ParseBoard("charuco:7x5:140mm:105mm");
  const BoardPainter painter(board);
  const Eigen::Matrix3d towards = camera.cam_from_world.rotation.conjugate().toRotationMatrix();
  const Image empty(640, 480, 3, 7);
  Image back = empty;
  Eigen::Matrix3d rotated = towards;
  rotated.col(1) *= -1, rotated.col(2) *= -1;
  painter.Draw({Eigen::Quaterniond(rotated), Eigen::Vector3d(0, 0, 1)}, camera, rays, 3, &back);
  int card = 0;
  for (size_t i = 0; i < back.pixels.size(); i += 3) {
    EXPECT_LE(back.pixels[i], 121);
    card += back.pixels[i] > 90;
  }
  EXPECT_GT(card, 5000);
  Image behind = empty;
  painter.Draw({Eigen::Quaterniond(towards), camera.CenterInWorld() - 2 * towards.col(2)}, camera, rays, 3, &behind);
  EXPECT_EQ(behind.pixels, empty.pixels);
}

}  // namespace
}  // namespace mvstudio::synth
