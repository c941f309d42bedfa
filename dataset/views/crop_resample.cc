#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/check.h"
#include "core/parallel.h"
#include "dataset/views/bilinear_taps.h"
#include "dataset/views/crop.h"

namespace mvstudio::dataset {
namespace {

using namespace internal;  // NOLINT: the helpers of this module

constexpr double kSpacingPx = 1.25;      // of samples in the source, at most; bilinear samples reach a pixel to all sides
constexpr int kFinestStep = 2;           // pixels between knots, see kCoarsestStep
constexpr double kWidestCellPx = 400;    // between knots, in the source
constexpr double kTolerancePx = 5e-4;    // of a knot cell's middle
constexpr double kMaxExactShare = 0.02;  // of the cells; more than that and the knots move closer
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

using PointRow = std::vector<double>;

// Pixels of one cell in one row, and where the cell begins.
struct PixelRange {
  int begin, end, cell_begin;
};

// What one row of pixels has gathered so far.
struct RowSums {
  std::vector<int32_t> sums;  // (width, 4), grey levels times kWeightUnit
  std::vector<int> inside;    // (width): samples that lie in the source
  explicit RowSums(int width) : sums(4 * static_cast<size_t>(width)), inside(width) {}
  int32_t* Of(int x) { return sums.data() + 4 * static_cast<size_t>(x); }
};

// True when the row of a cell is so short and so near the image that offsets from its start fit the fast path.
bool IsNear(const Cubic* along) {
  constexpr double kFar = 1e5, kLong = 1000;
  for (int k = 0; k < 2; ++k) {
    const Cubic& c = along[k];
    if (!(std::abs(c.c0) < kFar && std::abs(c.c1) + std::abs(c.c2) + std::abs(c.c3) < kLong)) return false;
  }
  return true;
}

}  // namespace

struct ResampleMap::Knots {
  geometry::Projector from, to;
  Eigen::Matrix3d from_to;  // rotates rays of `to` into `from`
  double shrink = 1;        // source pixels a pixel, 1 at least
  int samples = 1;          // a side of a pixel
  int step = kCoarsestStep;
  int cell_cols = 0, cell_rows = 0;
  std::vector<double> u, v;  // (cell_rows + 3, cell_cols + 3): knot (i, j) stands at pixel -0.5 + step (i - 1), …
  enum Cell : uint8_t { kSmooth, kExact, kOutside };
  std::vector<Cell> cells;  // (cell_rows, cell_cols): kExact where the lens is asked for every sample

  Knots(const geometry::RigCamera& source, const geometry::RigCamera& target)
      : from(source.camera),
        to(target.camera),
        from_to((source.cam_from_world.rotation * target.cam_from_world.rotation.conjugate()).toRotationMatrix()) {}

  Eigen::Vector2d Exact(double x, double y) const {
    Eigen::Vector3d ray((x - to.camera().cx()) / to.camera().fx(), (y - to.camera().cy()) / to.camera().fy(), 1);
    if (to.camera().model != geometry::LensModel::kPinhole) {
      const geometry::Unprojection unprojection = to.Unproject({x, y});
      if (unprojection.status != Status::kOk) return Eigen::Vector2d::Constant(kNaN);
      ray = unprojection.ray_in_cam;
    }
    const geometry::Projection projection = from.Project(from_to * ray);
    return projection.status == Status::kOk ? projection.px : Eigen::Vector2d::Constant(kNaN);
  }
  int width() const { return from.camera().width_px; }
  int height() const { return from.camera().height_px; }
  int to_width() const { return to.camera().width_px; }
  int to_height() const { return to.camera().height_px; }
  int knot_cols() const { return cell_cols + 3; }

  void ChooseDensity();
  void Place();
  Cell Judge(int col, int row) const;
  Cell At(int col, int row) const { return cells[static_cast<size_t>(row) * cell_cols + col]; }
  void KnotRow(double y, PointRow* row_u, PointRow* row_v) const;
  Tap TapAt(double x, double y) const;
  void AddSampleRow(const Image& source, double y, RowSums* sums) const;
  void AddOneByOne(const Image& source, double y, PixelRange pixels, const Cubic* along, RowSums* sums) const;
  template <int kChannels>
  void AddCell(const Image& source, double y, PixelRange pixels, const Cubic* along, RowSums* sums) const;
};

// Source pixels a pixel, at the worst of 25 places that lie in the source and of the one that sees the middle of the source.
void ResampleMap::Knots::ChooseDensity() {
  constexpr double kStep = 0.05;
  for (int place = 0; place < 26; ++place) {
    Eigen::Vector2d px((place % 5 + 0.5) / 5 * to_width(), (place / 5 + 0.5) / 5 * to_height());
    if (place == 25) {
      const geometry::Unprojection middle = from.Unproject({(width() - 1) / 2.0, (height() - 1) / 2.0});
      px = to.Project(from_to.transpose() * middle.ray_in_cam).px;
    }
    const Eigen::Vector2d here = Exact(px[0], px[1]), right = Exact(px[0] + kStep, px[1]), below = Exact(px[0], px[1] + kStep);
    if (!here.allFinite() || !geometry::InImage(from.camera(), here)) continue;
    for (const double distance : {(right - here).norm() / kStep, (below - here).norm() / kStep}) {
      if (std::isfinite(distance)) shrink = std::max(shrink, distance);
    }
  }
  samples = static_cast<int>(std::ceil(std::min<double>(kMaxSamples, shrink / kSpacingPx) - 1e-6));
  while (step > kFinestStep && step * shrink > kWidestCellPx) step /= 2;
}

void ResampleMap::Knots::Place() {
  cell_cols = (to_width() + step - 1) / step, cell_rows = (to_height() + step - 1) / step;
  u.resize(static_cast<size_t>(knot_cols()) * (cell_rows + 3)), v.resize(u.size());
  for (int j = 0; j < cell_rows + 3; ++j) {
    for (int i = 0; i < knot_cols(); ++i) {
      const Eigen::Vector2d px = Exact(-0.5 + step * (i - 1), -0.5 + step * (j - 1));
      u[static_cast<size_t>(j) * knot_cols() + i] = px[0], v[static_cast<size_t>(j) * knot_cols() + i] = px[1];
    }
  }
  cells.clear();
  for (int row = 0; row < cell_rows; ++row) {
    for (int col = 0; col < cell_cols; ++col) cells.push_back(Judge(col, row));
  }
}

// kSmooth where the cubic is good enough at the middle of a cell; kOutside where no part of it can see the source.
ResampleMap::Knots::Cell ResampleMap::Knots::Judge(int col, int row) const {
  double mid_u[4], mid_v[4];
  bool seen = false;
  for (int j = 0; j < 4; ++j) {
    const size_t at = static_cast<size_t>(row + j) * knot_cols() + col;
    mid_u[j] = Cubic(u[at], u[at + 1], u[at + 2], u[at + 3])(0.5);
    mid_v[j] = Cubic(v[at], v[at + 1], v[at + 2], v[at + 3])(0.5);
    seen |= std::any_of(&u[at], &u[at] + 4, [](double x) { return std::isfinite(x); });
  }
  const Eigen::Vector2d cubic(Cubic(mid_u[0], mid_u[1], mid_u[2], mid_u[3])(0.5),
                              Cubic(mid_v[0], mid_v[1], mid_v[2], mid_v[3])(0.5));
  const Eigen::Vector2d truth = Exact(-0.5 + step * (col + 0.5), -0.5 + step * (row + 0.5));
  if (!seen && !truth.allFinite()) return kOutside;
  if (!cubic.allFinite() || !truth.allFinite()) return kExact;
  const size_t corner = static_cast<size_t>(row + 1) * knot_cols() + col + 1, across = corner + knot_cols() + 1;
  const double reach = 1 + std::hypot(u[across] - u[corner], v[across] - v[corner]);
  const bool outside = truth[0] < -reach || truth[1] < -reach || truth[0] > width() + reach || truth[1] > height() + reach;
  if (outside) return kOutside;
  return (cubic - truth).cwiseAbs().maxCoeff() <= kTolerancePx * shrink ? kSmooth : kExact;
}

// The knots' cubics along y, evaluated at y for every column of knots.
void ResampleMap::Knots::KnotRow(double y, PointRow* row_u, PointRow* row_v) const {
  const int row = std::clamp(static_cast<int>((y + 0.5) / step), 0, cell_rows - 1);
  const double t = (y + 0.5) / step - row;
  row_u->resize(knot_cols()), row_v->resize(knot_cols());
  const size_t line = knot_cols();
  for (size_t i = 0; i < line; ++i) {
    const size_t at = row * line + i;
    (*row_u)[i] = Cubic(u[at], u[at + line], u[at + 2 * line], u[at + 3 * line])(t);
    (*row_v)[i] = Cubic(v[at], v[at + line], v[at + 2 * line], v[at + 3 * line])(t);
  }
}

Tap ResampleMap::Knots::TapAt(double x, double y) const {
  Tap tap;
  if (!(x > -0.5 && y > -0.5 && x < width() - 0.5 && y < height() - 0.5)) return tap;
  const double inside_x = std::clamp(x, 0.0, width() - 1.0), inside_y = std::clamp(y, 0.0, height() - 1.0);
  const int x0 = std::min(static_cast<int>(inside_x), std::max(0, width() - 2)),
            y0 = std::min(static_cast<int>(inside_y), std::max(0, height() - 2));
  const float fx = static_cast<float>(inside_x - x0), fy = static_cast<float>(inside_y - y0) * kWeightUnit;
  tap.at = static_cast<int64_t>(y0) * width() + x0;
  tap.right = x0 + 1 < width(), tap.below = y0 + 1 < height() ? width() : 0;
  const float across = fx * fy;
  tap.weights[3] = static_cast<int16_t>(across + 0.5f);
  tap.weights[2] = static_cast<int16_t>(fy - across + 0.5f);
  tap.weights[1] = static_cast<int16_t>(fx * kWeightUnit - across + 0.5f);
  tap.weights[0] = static_cast<int16_t>(static_cast<int>(kWeightUnit) - tap.weights[1] - tap.weights[2] - tap.weights[3]);
  return tap;
}

// The samples of some pixels of a cell, near the border or where the lens is asked for each (`along` is null then).
void ResampleMap::Knots::AddOneByOne(const Image& source, double y, PixelRange pixels, const Cubic* along,
                                     RowSums* sums) const {
  for (int s = pixels.begin * samples; s < pixels.end * samples; ++s) {
    const double x = (s + 0.5) / samples - 0.5, t = (x + 0.5 - pixels.cell_begin) / step;
    const Eigen::Vector2d px = along ? Eigen::Vector2d(along[0](t), along[1](t)) : Exact(x, y);
    const Tap tap = TapAt(px[0], px[1]);
    if (tap.at < 0) continue;
    AddScalar(source.pixels.data(), source.channels, tap, sums->Of(s / samples));
    ++sums->inside[s / samples];
  }
}

template <int kChannels>
void ResampleMap::Knots::AddCell(const Image& source, double y, PixelRange pixels, const Cubic* along, RowSums* sums) const {
  CellTaps taps;
  const int count = (pixels.end - pixels.begin) * samples;
  const bool all_inside = PlaceTaps(along[0], along[1], count, 1.f / static_cast<float>(step * samples), source, &taps);
  for (int x = pixels.begin; x < pixels.end; ++x) {
    const int begin = (x - pixels.begin) * samples;
    if (all_inside || std::count(taps.outside + begin, taps.outside + begin + samples, 0) == samples) {
      AddTaps<kChannels>(source, taps, begin, samples, sums->Of(x));
      sums->inside[x] += samples;
    } else {
      AddOneByOne(source, y, {x, x + 1, pixels.cell_begin}, along, sums);
    }
  }
}

// Adds the samples of one row, `samples` for each pixel.
void ResampleMap::Knots::AddSampleRow(const Image& source, double y, RowSums* sums) const {
  PointRow row_u, row_v;
  KnotRow(y, &row_u, &row_v);
  const int row = std::clamp(static_cast<int>((y + 0.5) / step), 0, cell_rows - 1);
  for (int col = 0; col < cell_cols; ++col) {
    const PixelRange pixels{col * step, std::min(to_width(), (col + 1) * step), col * step};
    const Cubic along[2] = {{row_u[col], row_u[col + 1], row_u[col + 2], row_u[col + 3]},
                            {row_v[col], row_v[col + 1], row_v[col + 2], row_v[col + 3]}};
    const Cell cell = At(col, row);
    if (cell == kOutside) continue;
    if (cell == kExact) {
      AddOneByOne(source, y, pixels, nullptr, sums);
    } else if (IsNear(along) && source.channels == 3) {
      AddCell<3>(source, y, pixels, along, sums);
    } else if (IsNear(along) && source.channels == 1) {
      AddCell<1>(source, y, pixels, along, sums);
    } else {
      AddOneByOne(source, y, pixels, along, sums);
    }
  }
}

namespace {

void RequireSource(const Image& source, const geometry::Camera& camera) {
  MVS_CHECK(source.width == camera.width_px && source.height == camera.height_px,
            "image of " << source.width << "x" << source.height << " for camera " << camera.name << " of " << camera.width_px
                        << "x" << camera.height_px);
  MVS_CHECK(source.channels >= 1 && source.channels <= 4, source.channels << " channels");
}

}  // namespace

ResampleMap::ResampleMap(const geometry::RigCamera& from, const geometry::RigCamera& to) {
  const auto knots = std::make_shared<Knots>(from, to);
  knots->ChooseDensity();
  for (;; knots->step /= 2) {
    knots->Place();
    const auto rough = std::count(knots->cells.begin(), knots->cells.end(), Knots::kExact);
    if (knots->step == kFinestStep || static_cast<double>(rough) <= kMaxExactShare * static_cast<double>(knots->cells.size()))
      break;
  }
  knots_ = knots;
}

int ResampleMap::samples_per_side() const { return knots_->samples; }

Eigen::Vector2d ResampleMap::SourceOf(const Eigen::Vector2d& px) const { return knots_->Exact(px[0], px[1]); }

Eigen::Vector2d ResampleMap::SampledSourceOf(const Eigen::Vector2d& px) const {
  const Knots& k = *knots_;
  const int col = std::clamp(static_cast<int>((px[0] + 0.5) / k.step), 0, k.cell_cols - 1),
            row = std::clamp(static_cast<int>((px[1] + 0.5) / k.step), 0, k.cell_rows - 1);
  if (k.At(col, row) != Knots::kSmooth) return k.Exact(px[0], px[1]);
  PointRow u, v;
  k.KnotRow(px[1], &u, &v);
  const double t = (px[0] + 0.5) / k.step - col;
  return {Cubic(u[col], u[col + 1], u[col + 2], u[col + 3])(t), Cubic(v[col], v[col + 1], v[col + 2], v[col + 3])(t)};
}

namespace {

// Means over the footprints from their sums, rounded.
void WriteRow(const RowSums& sums, int samples, Border border, int y, Image* out) {
  const float all = 1 / (kWeightUnit * static_cast<float>(samples * samples));
  for (int x = 0; x < out->width; ++x) {
    const int inside = sums.inside[x];
    const bool partly = border == Border::kLeave && inside > 0 && inside < samples * samples;
    const float scale = partly ? 1 / (kWeightUnit * static_cast<float>(inside)) : all;
    uint8_t* pixel = out->Pixel(x, y);
    for (int c = 0; c < out->channels; ++c) {
      const int value = static_cast<int>(static_cast<float>(sums.sums[4 * static_cast<size_t>(x) + c]) * scale + 0.5f);
      pixel[c] = static_cast<uint8_t>(std::clamp(value, 0, 255));
    }
  }
}

}  // namespace

Image ResampleMap::Apply(const Image& source, Border border, int num_threads) const {
  const Knots& k = *knots_;
  RequireSource(source, k.from.camera());
  Image out(k.to_width(), k.to_height(), source.channels);
  constexpr int kRows = 16;  // a piece of work
  ParallelFor((out.height + kRows - 1) / kRows, num_threads, [&](int64_t piece) {
    for (int y = static_cast<int>(piece) * kRows; y < std::min(out.height, static_cast<int>(piece + 1) * kRows); ++y) {
      RowSums sums(out.width);
      for (int i = 0; i < k.samples; ++i) k.AddSampleRow(source, y + (i + 0.5) / k.samples - 0.5, &sums);
      WriteRow(sums, k.samples, border, y, &out);
    }
  });
  return out;
}

Image ResampleMap::Mask(const Image& source, int num_threads) const {
  MVS_CHECK(source.channels == 1, "a mask has one channel, not " << source.channels);
  Image mask = Apply(source, Border::kBlack, num_threads);
  for (uint8_t& value : mask.pixels) value = value >= 128 ? 255 : 0;
  return mask;
}

Image ResampleMap::Validity() const {
  const geometry::Camera& from = knots_->from.camera();
  return Mask(Image(from.width_px, from.height_px, 1, 255));
}

Image Resample(const Image& source, const geometry::RigCamera& from, const geometry::RigCamera& to) {
  RequireSource(source, from.camera);
  return ResampleMap(from, to).Apply(source);
}

}  // namespace mvstudio::dataset
