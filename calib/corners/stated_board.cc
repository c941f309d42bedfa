#include <algorithm>
#include <cmath>
#include <map>

#include "calib/corners/corner_readers.h"
#include "core/error.h"
#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::calib::internal {

void CompareBoard(const std::map<int, Eigen::Vector3d>& stated, const Board& given, const std::string& path,
                  std::vector<Notice>* notes) {
  constexpr double kSameSize = 0.01, kSameShape = 0.2;  // of the distance of corners that follow each other
  const Eigen::Matrix3Xd places = CornersInBoard(given);
  std::vector<double> ratios;
  const std::pair<const int, Eigen::Vector3d>* before = nullptr;
  for (const auto& corner : stated) {
    if (corner.first < 0 || corner.first >= places.cols()) continue;  // refused where it was seen
    if (before) {
      const double here = (places.col(corner.first) - places.col(before->first)).norm();
      if (here > 0) ratios.push_back((corner.second - before->second).norm() / here);
    }
    before = &corner;
  }
  if (ratios.size() < 3) return;
  const double scale = UpperMedian(ratios, 1.0);
  const bool other_shape =
      std::any_of(ratios.begin(), ratios.end(), [&](double ratio) { return !(std::abs(ratio / scale - 1) < kSameShape); });
  if (other_shape)
    throw FormatError(path, "",
                      "the places of its corners are not those of option 'board' " + ToString(given) +
                          ", which has other rows and columns or another numbering; leave it out to take the file's");
  if (std::abs(scale - 1) < kSameSize) return;
  notes->push_back({"CAL-BOARD-SIZE",
                    Format("%s: its corners stand %.4g times as far apart as those of option 'board' %s, which is used",
                           path.c_str(), scale, ToString(given).c_str()),
                    "measure the board: its size gives that of the whole rig; the unit of the file's lengths may be another"});
}

}  // namespace mvstudio::calib::internal
