#include "stages/calib/board_places.h"

#include <algorithm>
#include <cmath>

#include "calib/covariance/uncertainty.h"
#include "core/format.h"
#include "core/units.h"
#include "stages/calib/solved_state.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

Eigen::Vector3d MiddleOf(const calib::Board& board) {
  const Eigen::Matrix3Xd corners = calib::CornersInBoard(calib::FrontOf(board));
  return (corners.rowwise().minCoeff() + corners.rowwise().maxCoeff()) / 2;
}

/// A board that was never linked to the first keeps the pose that it started with.
bool IsPlaced(const geometry::Rigid3& first_from_board) {
  return first_from_board.translation.norm() > 0 ||
         first_from_board.rotation.angularDistance(Eigen::Quaterniond::Identity()) > 0;
}

/// Boards of this name, the backs of others left out.
int FrontsLike(const PlacedBoards& placed, const std::string& name) {
  int count = 0;
  for (size_t b = 0; b < placed.boards.size(); ++b) {
    if (placed.front_of[b] < 0 && calib::ToString(placed.boards[b]) == name) ++count;
  }
  return count;
}

}  // namespace

BoardPlace PlaceOf(const calib::Board& first, const calib::Board& board, const geometry::Rigid3& first_from_board) {
  const double cosine = (first_from_board.rotation * Eigen::Vector3d::UnitZ()).z();
  const Eigen::Vector3d offset = first_from_board * MiddleOf(board) - MiddleOf(first);
  BoardPlace place;
  place.opposite = cosine < 0;
  place.tilt_deg = RadToDeg(std::acos(std::min(1.0, std::abs(cosine))));
  place.behind_mm = 1e3 * offset.z();
  place.aside_mm = 1e3 * offset.head<2>().norm();
  return place;
}

std::vector<double> BehindSigmasMm(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards) {
  std::vector<double> sigmas(boards.size(), 0);
  if (boards.size() < 2 || report.rig_from_board.size() != boards.size() || !IsWholeState(report)) return sigmas;
  const SolvedState solved = StateOf(report, boards, KeptCorners(report), BoardPoses(report));
  const calib::RigCovariance covariance = calib::ComputeCovariance(solved.views, solved.state, solved.options, report.sigma_px);
  if (covariance.status != Status::kOk) return sigmas;
  for (size_t b = 1; b < boards.size(); ++b) {
    const int at = covariance.columns.board[b];
    if (at < 0 || !IsPlaced(report.rig_from_board[b])) continue;
    Eigen::Matrix<double, 6, 1> slope;  // mm per unit of the pose's left perturbation
    for (int i = 0; i < 6; ++i) {
      constexpr double kStep = 1e-6;
      const Eigen::Matrix<double, 6, 1> step = kStep * Eigen::Matrix<double, 6, 1>::Unit(i);
      const auto behind = [&](const auto& by) {
        return PlaceOf(boards[0], boards[b], geometry::Perturb(by, report.rig_from_board[b])).behind_mm;
      };
      slope[i] = (behind(step) - behind(Eigen::Matrix<double, 6, 1>(-step))) / (2 * kStep);
    }
    sigmas[b] = std::sqrt(std::max(0.0, slope.dot(covariance.joint.block<6, 6>(at, at) * slope)));
  }
  return sigmas;
}

ordered_json BoardPlacesJson(const PlacedBoards& placed) {
  ordered_json rows = ordered_json::array();
  for (size_t b = 1; b < std::min(placed.boards.size(), placed.first_from_board.size()); ++b) {
    rows.push_back({{"board", calib::ToString(placed.boards[b])}});
    if (placed.front_of[b] >= 0) rows.back()["back_of"] = placed.front_of[b];
    if (!IsPlaced(placed.first_from_board[b])) {
      rows.back()["place"] = nullptr;
      continue;
    }
    const BoardPlace place = PlaceOf(placed.boards[0], placed.boards[b], placed.first_from_board[b]);
    rows.back()["place"] = {{"back_to_back", place.opposite},
                            {"tilt_deg", place.tilt_deg},
                            {"behind_mm", place.behind_mm},
                            {"behind_sigma_mm", nullptr},
                            {"aside_mm", place.aside_mm}};
    if (placed.behind_sigmas_mm[b] > 0) rows.back()["place"]["behind_sigma_mm"] = placed.behind_sigmas_mm[b];
  }
  return rows;
}

std::string BoardPlacesText(const PlacedBoards& placed) {
  std::string text;
  for (size_t b = 1; b < std::min(placed.boards.size(), placed.first_from_board.size()); ++b) {
    const std::string name = calib::ToString(placed.boards[b]);
    const bool is_back = placed.front_of[b] >= 0;
    const size_t front = is_back ? static_cast<size_t>(placed.front_of[b]) : b;
    text += (is_back ? "back of board " : "board ") + (FrontsLike(placed, name) > 1 ? std::to_string(front) + " " : "") + name;
    if (!IsPlaced(placed.first_from_board[b])) {
      text += ": no frame shows it together with those before: its place is not known\n";
      continue;
    }
    const BoardPlace place = PlaceOf(placed.boards[0], placed.boards[b], placed.first_from_board[b]);
    const double sigma_mm = placed.behind_sigmas_mm[b];
    const std::string facing = place.opposite ? "faces away from the first, " : "faces the same way as the first, ";
    text +=
        Format(": %stilted by %.2f degrees, its middle %.2f mm%s behind and %.1f mm aside\n", is_back ? "" : facing.c_str(),
               place.tilt_deg, place.behind_mm, sigma_mm > 0 ? Format(" +- %.2g mm", sigma_mm).c_str() : "", place.aside_mm);
  }
  return text;
}

}  // namespace mvstudio::stages
