#include "app/calib/board_places.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"
#include "core/units.h"

namespace mvstudio::app {
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

ordered_json BoardPlacesJson(const std::vector<calib::Board>& boards, const std::vector<geometry::Rigid3>& first_from_board) {
  ordered_json rows = ordered_json::array();
  for (size_t b = 1; b < std::min(boards.size(), first_from_board.size()); ++b) {
    rows.push_back({{"board", calib::ToString(boards[b])}});
    if (!IsPlaced(first_from_board[b])) {
      rows.back()["place"] = nullptr;
      continue;
    }
    const BoardPlace place = PlaceOf(boards[0], boards[b], first_from_board[b]);
    rows.back()["place"] = {{"back_to_back", place.opposite},
                            {"tilt_deg", place.tilt_deg},
                            {"behind_mm", place.behind_mm},
                            {"aside_mm", place.aside_mm}};
  }
  return rows;
}

std::string BoardPlacesText(const std::vector<calib::Board>& boards, const std::vector<geometry::Rigid3>& first_from_board) {
  std::string text;
  for (size_t b = 1; b < std::min(boards.size(), first_from_board.size()); ++b) {
    if (!IsPlaced(first_from_board[b])) continue;
    const BoardPlace place = PlaceOf(boards[0], boards[b], first_from_board[b]);
    text += Format("board %s: %s the first, tilted by %.2f degrees, its middle %.2f mm behind and %.1f mm aside\n",
                   calib::ToString(boards[b]).c_str(), place.opposite ? "faces away from" : "faces the same way as",
                   place.tilt_deg, place.behind_mm, place.aside_mm);
  }
  return text;
}

}  // namespace mvstudio::app
