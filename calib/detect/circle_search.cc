#include "calib/detect/circle_search.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <deque>
#include <opencv2/imgproc.hpp>
#include <set>

#include "core/units.h"

namespace mvstudio::calib {
namespace {

using Cell = std::pair<int, int>;

constexpr double kLeastArea = 16, kMostShare = 0.05;  // px^2; of the image
constexpr double kOutlineSlack = 0.12;                // of the ellipse's area
constexpr double kLeastFlat = 0.12;                   // of the short axis to the long one
constexpr double kStepSlack = 0.25;                   // of a step, between a spot and where its neighbours put it

/// The ellipse with the moments of the outline's inside; nothing where the outline is none.
std::optional<Spot> SpotOf(const std::vector<cv::Point>& outline, double most_area) {
  const cv::Moments m = cv::moments(outline);
  // The outline runs through the centres of the outermost pixels: half a pixel is missing on all sides.
  const double area = m.m00 + 0.5 * cv::arcLength(outline, true) + 1;
  if (m.m00 < kLeastArea || m.m00 > most_area) return std::nullopt;
  Spot spot;
  spot.px = {m.m10 / m.m00, m.m01 / m.m00};
  spot.shape << m.mu20, m.mu11, m.mu11, m.mu02;
  spot.shape *= 4 / m.m00;  // of an ellipse, second moments are a quarter of the squared half axes
  const double inside = kPi * std::sqrt(std::max(0.0, spot.shape.determinant()));
  if (!(inside > 0) || std::abs(m.m00 / inside - 1) > kOutlineSlack) return std::nullopt;
  std::vector<cv::Point> hull;
  cv::convexHull(outline, hull);
  if (cv::contourArea(hull) > (1 + kOutlineSlack) * m.m00 + 2 * std::sqrt(m.m00)) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(spot.shape, Eigen::EigenvaluesOnly);
  if (axes.eigenvalues()[0] < kLeastFlat * kLeastFlat * axes.eigenvalues()[1]) return std::nullopt;
  spot.shape *= area / m.m00;
  return spot;
}

bool Overlaps(const Spot& a, const Spot& b) {
  const Eigen::Vector2d d = a.px - b.px;
  return d.dot(a.shape.inverse() * d) < 1 || d.dot(b.shape.inverse() * d) < 1;
}

/// Spots of one threshold: darker than the mean of a window.
void AddSpots(const cv::Mat& smooth, int window, std::vector<Spot>* spots) {
  constexpr double kDarker = 6;
  cv::Mat dark;
  cv::adaptiveThreshold(smooth, dark, 255, cv::ADAPTIVE_THRESH_MEAN_C, cv::THRESH_BINARY_INV, window | 1, kDarker);
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(dark, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
  for (const auto& outline : outlines) {
    const cv::Rect box = cv::boundingRect(outline);
    const bool cut = box.x <= 1 || box.y <= 1 || box.br().x >= dark.cols - 1 || box.br().y >= dark.rows - 1;
    if (cut || outline.size() < 8) continue;
    const auto spot = SpotOf(outline, kMostShare * dark.cols * dark.rows);
    if (!spot ||
        dark.at<uint8_t>(static_cast<int>(std::lround(spot->px.y())), static_cast<int>(std::lround(spot->px.x()))) == 0)
      continue;
    const bool known = std::any_of(spots->begin(), spots->end(), [&](const Spot& other) { return Overlaps(*spot, other); });
    if (!known) spots->push_back(*spot);
  }
}

/// Where `to` lies from `from`, in the plane in which that one is a circle of radius 1.
Eigen::Vector2d Unfolded(const Spot& from, const Eigen::Vector2d& to) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(from.shape);
  return axes.operatorInverseSqrt() * (to - from.px);
}

bool AlikeInSize(const Spot& a, const Spot& b) {
  constexpr double kRatio = 2;  // of areas of neighbours
  return a.area_px() < kRatio * b.area_px() && b.area_px() < kRatio * a.area_px();
}

/// The nearest neighbour of spot `at`, and the nearest across to it; -1: none.
std::pair<int, int> Neighbours(const std::vector<Spot>& spots, int at) {
  constexpr double kFarthest = 14;  // radii
  std::vector<std::pair<double, int>> near;
  for (int i = 0; i < static_cast<int>(spots.size()); ++i) {
    const double distance = i == at ? kFarthest : Unfolded(spots[at], spots[i].px).norm();
    if (distance < kFarthest && AlikeInSize(spots[at], spots[i])) near.push_back({distance, i});
  }
  if (near.size() < 3) return {-1, -1};
  std::sort(near.begin(), near.end());
  const Eigen::Vector2d first = Unfolded(spots[at], spots[near[0].second].px).normalized();
  for (const auto& [distance, i] : near) {
    const double along = std::abs(Unfolded(spots[at], spots[i].px).normalized().dot(first));
    if (along < 0.5) return {near[0].second, i};
  }
  return {-1, -1};
}

/// Grows a lattice from one spot.
class Grower {
 public:
  explicit Grower(const std::vector<Spot>& spots) : spots_(spots), cell_of_(spots.size()) {}

  SpotLattice From(int seed) {
    const auto [along, across] = Neighbours(spots_, seed);
    if (along < 0) return {};
    steps_ = {spots_[along].px - spots_[seed].px, spots_[across].px - spots_[seed].px};
    if (steps_[0].x() * steps_[1].y() - steps_[0].y() * steps_[1].x() < 0) std::swap(steps_[0], steps_[1]);
    Put({0, 0}, seed);
    while (!open_.empty()) {
      const Cell cell = open_.front();
      open_.pop_front();
      for (const int axis : {0, 1}) {
        for (const int sign : {1, -1}) Extend(cell, axis, sign);
      }
    }
    return lattice_;
  }

 private:
  void Put(const Cell& cell, int spot) {
    lattice_[cell] = spot;
    cell_of_[spot] = true;
    open_.push_back(cell);
  }
  const Eigen::Vector2d* At(const Cell& cell) const {
    const auto found = lattice_.find(cell);
    return found == lattice_.end() ? nullptr : &spots_[found->second].px;
  }
  static Cell Moved(const Cell& cell, int axis, int by) {
    return axis == 0 ? Cell(cell.first + by, cell.second) : Cell(cell.first, cell.second + by);
  }

  /// The step from `cell`: as the one before it, or as that of the cells beside it.
  Eigen::Vector2d StepFrom(const Cell& cell, int axis, int sign) const {
    const Eigen::Vector2d& here = *At(cell);
    if (const auto* before = At(Moved(cell, axis, -sign))) return here - *before;
    for (const int side : {1, -1}) {
      const Cell beside = Moved(cell, 1 - axis, side);
      const auto *from = At(beside), *to = At(Moved(beside, axis, sign));
      if (from && to) return *to - *from;
    }
    return sign * steps_[axis];
  }

  void Extend(const Cell& cell, int axis, int sign) {
    const Cell next = Moved(cell, axis, sign);
    if (lattice_.count(next) > 0) return;
    const Eigen::Vector2d step = StepFrom(cell, axis, sign), at = *At(cell) + step;
    int best = -1;
    double nearest = kStepSlack * step.norm();
    for (int i = 0; i < static_cast<int>(spots_.size()); ++i) {
      const double distance = (spots_[i].px - at).norm();
      if (cell_of_[i] || distance >= nearest || !AlikeInSize(spots_[i], spots_[lattice_.at(cell)])) continue;
      nearest = distance, best = i;
    }
    if (best >= 0) Put(next, best);
  }

  const std::vector<Spot>& spots_;
  std::vector<bool> cell_of_;
  std::vector<Eigen::Vector2d> steps_;
  SpotLattice lattice_;
  std::deque<Cell> open_;
};

/// By a quarter turn.
SpotLattice Rotated(const SpotLattice& lattice) {
  SpotLattice rotated;
  for (const auto& [cell, spot] : lattice) rotated[{-cell.second, cell.first}] = spot;
  return rotated;
}

/// The board's circles as cells of a lattice, by number. The lattice of asymmetric grids runs along their diagonals.
std::vector<Cell> CellsOf(const Board& board) {
  std::vector<Cell> cells;
  for (int i = 0; i < board.num_corners(); ++i) {
    const int row = i / board.cols, col = i % board.cols, x = 2 * col + row % 2;
    const bool shifted = board.kind == Board::Kind::kAsymmetricCircles;
    cells.push_back(shifted ? Cell((x + row) / 2, (row - x) / 2) : Cell(col, row));
  }
  return cells;
}

Cell Least(const std::vector<Cell>& cells) {
  Cell least = cells.front();
  for (const Cell& c : cells) least = {std::min(least.first, c.first), std::min(least.second, c.second)};
  return least;
}

/// The places at which the lattice holds all of the board's cells, as spots by number.
std::vector<std::vector<int>> PlacesIn(const std::vector<Cell>& cells, const SpotLattice& lattice) {
  std::vector<std::vector<int>> places;
  for (const auto& [first, first_spot] : lattice) {
    std::vector<int> spots;
    for (const Cell& cell : cells) {
      const auto found =
          lattice.find({first.first + cell.first - cells[0].first, first.second + cell.second - cells[0].second});
      if (found == lattice.end()) break;
      spots.push_back(found->second);
    }
    if (spots.size() == cells.size()) places.push_back(std::move(spots));
  }
  return places;
}

}  // namespace

double Spot::area_px() const { return kPi * std::sqrt(std::max(0.0, shape.determinant())); }

std::vector<Spot> FindSpots(const Image& grey) {
  const cv::Mat image(grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data()));
  cv::Mat smooth;
  cv::GaussianBlur(image, smooth, {3, 3}, 0.8);
  const int side = std::max(grey.width, grey.height);
  std::vector<Spot> spots;
  for (const int part : {5, 14, 40}) AddSpots(smooth, std::max(11, side / part), &spots);
  return spots;
}

std::vector<SpotLattice> FindLattices(const std::vector<Spot>& spots) {
  constexpr size_t kMostSpots = 4000, kMostSeeds = 60, kFewest = 4;
  std::vector<SpotLattice> lattices;
  if (spots.size() > kMostSpots) return lattices;
  std::set<int> used;
  for (size_t i = 0, seeds = 0; i < spots.size() && seeds < kMostSeeds; ++i) {
    const int seed = static_cast<int>((i * 7919) % spots.size());  // spread over the image
    if (!used.insert(seed).second) continue;
    SpotLattice lattice = Grower(spots).From(seed);
    ++seeds;
    if (lattice.size() < kFewest) continue;
    for (const auto& [cell, spot] : lattice) used.insert(spot);
    lattices.push_back(std::move(lattice));
  }
  std::stable_sort(lattices.begin(), lattices.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return lattices;
}

std::vector<int> CirclesInLattice(const Board& board, const SpotLattice& lattice, const std::vector<Spot>& spots) {
  const std::vector<Cell> cells = CellsOf(board);
  std::vector<int> best;
  double most_right = -2;
  if (lattice.size() < cells.size()) return best;
  SpotLattice rotated = lattice;
  for (int quarters = 0; quarters < 4; ++quarters, rotated = Rotated(rotated)) {
    const auto places = PlacesIn(cells, rotated);
    if (places.size() > 1) return {};  // a larger grid holds this one in several places
    if (places.empty()) continue;
    const double right = (spots[places[0][board.cols - 1]].px - spots[places[0][0]].px).normalized().x();
    if (right > most_right) most_right = right, best = places[0];
  }
  return best;
}

std::optional<Board> GuessCircles(const SpotLattice& lattice) {
  constexpr size_t kFewest = 9;
  std::optional<Board> best;
  if (lattice.size() < kFewest) return best;
  SpotLattice rotated = lattice;
  for (int quarters = 0; quarters < 4; ++quarters, rotated = Rotated(rotated)) {
    for (const bool shifted : {false, true}) {
      std::map<int, std::vector<int>> rows;  // y -> x, ascending
      std::vector<Cell> cells;
      for (const auto& [cell, spot] : rotated) {
        const auto [i, j] = cell;
        cells.push_back(shifted ? Cell(i - j, i + j) : cell);
      }
      const Cell least = Least(cells);
      for (const Cell& cell : cells) rows[cell.second - least.second].push_back(cell.first - least.first);
      Board board;
      board.kind = shifted ? Board::Kind::kAsymmetricCircles : Board::Kind::kCircles;
      board.square_m = 1;
      board.cols = static_cast<int>(rows.begin()->second.size()), board.rows = static_cast<int>(rows.size());
      bool whole = board.cols >= (shifted ? 2 : 3) && board.rows >= 3;
      for (auto& [y, xs] : rows) {
        std::sort(xs.begin(), xs.end());
        whole &= static_cast<int>(xs.size()) == board.cols && xs[0] == (shifted ? y % 2 : 0);
        for (size_t k = 1; k < xs.size(); ++k) whole &= xs[k] - xs[k - 1] == (shifted ? 2 : 1);
      }
      whole &= rows.rbegin()->first == board.rows - 1;
      if (whole && (!best || board.cols > best->cols)) best = board;
    }
    if (best && best->kind == Board::Kind::kAsymmetricCircles) break;
  }
  return best;
}

}  // namespace mvstudio::calib
