#include "synth/board_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "calib/board/print.h"

namespace mvstudio::synth {
namespace {

constexpr int kPxPerSquare = 72;
constexpr double kMarginSquares = 0.375;
constexpr float kInk = 18, kPaper = 222;  // grey levels, so that nothing saturates

}  // namespace

BoardPainter::BoardPainter(const calib::Board& board)
    : board_(board), print_(calib::DrawBoard(board, kPxPerSquare, kMarginSquares)), px_per_m_(kPxPerSquare / board.square_m) {
  low_m_ = calib::PrintOf(board).low_m - Eigen::Vector2d::Constant(kMarginSquares * board.square_m);
  high_m_ = low_m_ + Eigen::Vector2d(print_.width, print_.height) / px_per_m_;
}

/// Bilinear sample of the print.
float BoardPainter::Print(double x_m, double y_m) const {
  const double u = std::clamp((x_m - low_m_[0]) * px_per_m_ - 0.5, 0.0, print_.width - 1.001);
  const double v = std::clamp((y_m - low_m_[1]) * px_per_m_ - 0.5, 0.0, print_.height - 1.001);
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const float fx = static_cast<float>(u - x), fy = static_cast<float>(v - y);
  const uint8_t *top = print_.Pixel(x, y), *bottom = print_.Pixel(x, y + 1);
  const float grey = (1 - fy) * ((1 - fx) * top[0] + fx * top[1]) + fy * ((1 - fx) * bottom[0] + fx * bottom[1]);
  return kInk + (kPaper - kInk) * grey / 255;
}

BoardPainter::Box BoardPainter::PixelBox(const geometry::Rigid3& world_from_board, double z_m,
                                         const geometry::RigCamera& camera) const {
  const geometry::Projector projector(camera.camera);
  const geometry::Rigid3 cam_from_board = camera.cam_from_world * world_from_board;
  const int width = camera.camera.width_px, height = camera.camera.height_px;
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  constexpr int kSteps = 24;
  int failed = 0;
  for (int i = 0; i < 4 * kSteps; ++i) {
    const double t = (i % kSteps) / static_cast<double>(kSteps);
    const Eigen::Vector2d corners[4] = {low_m_, {high_m_[0], low_m_[1]}, high_m_, {low_m_[0], high_m_[1]}};
    const Eigen::Vector2d at = (1 - t) * corners[i / kSteps] + t * corners[(i / kSteps + 1) % 4];
    const geometry::Projection p = projector.Project(cam_from_board * Eigen::Vector3d(at[0], at[1], z_m));
    if (p.status != Status::kOk) {
      ++failed;
      continue;
    }
    low = low.cwiseMin(p.px), high = high.cwiseMax(p.px);
  }
  if (failed == 4 * kSteps) return {0, 0, -1, -1};
  if (failed > 0) return {0, 0, width - 1, height - 1};
  auto clamp = [](double v, int n) { return static_cast<int>(std::clamp(v, -10.0, n + 10.0)); };
  return {std::max(0, clamp(low[0], width) - 2), std::max(0, clamp(low[1], height) - 2),
          std::min(width - 1, clamp(high[0], width) + 2), std::min(height - 1, clamp(high[1], height) + 2)};
}

void BoardPainter::Draw(const geometry::Rigid3& world_from_board, const geometry::RigCamera& camera, const LensRays& rays,
                        int samples, Image* image) const {
  const Eigen::Matrix3d board_from_world = world_from_board.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d eye = board_from_world * (camera.CenterInWorld() - world_from_board.translation);
  const bool front = eye[2] < 0, printed_side = front || board_.back_m;
  const double z_m = front ? 0 : board_.back_m.value_or(0);
  const Eigen::Vector3d normal_in_world = world_from_board.rotation * Eigen::Vector3d(0, 0, front ? -1 : 1);
  const float light = static_cast<float>(0.80 + 0.20 * std::max(0.0, normal_in_world.dot(Eigen::Vector3d(0.3, -0.4, 0.87))));
  const Box box = PixelBox(world_from_board, z_m, camera);
  for (int y = box.y0; y <= box.y1; ++y) {
    for (int x = box.x0; x <= box.x1; ++x) {
      float sum = 0;
      int hits = 0;
      for (int s = 0; s < samples * samples; ++s) {
        const Eigen::Vector3f ray =
            rays.Direction(x, y, (s % samples + 0.5) / samples - 0.5, (s / samples + 0.5) / samples - 0.5);
        const Eigen::Vector3d direction = board_from_world * ray.cast<double>();
        const double depth = (z_m - eye[2]) / direction[2];
        if (!(depth > 0) || !std::isfinite(depth)) continue;
        const double u = eye[0] + depth * direction[0], v = eye[1] + depth * direction[1];
        if (u < low_m_[0] || v < low_m_[1] || u > high_m_[0] || v > high_m_[1]) continue;
        ++hits;
        sum += printed_side ? light * Print(u, v) : light * 120;
      }
      if (hits == 0) continue;
      uint8_t* pixel = image->Pixel(x, y);
      const float total = static_cast<float>(samples * samples);
      for (int k = 0; k < 3; ++k) {
        pixel[k] = static_cast<uint8_t>(std::clamp((sum + (total - hits) * pixel[k]) / total + 0.5f, 0.f, 255.f));
      }
    }
  }
}

}  // namespace mvstudio::synth
