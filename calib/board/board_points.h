#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

namespace mvstudio::calib {

/// The points (3, N), metres, of a table with the columns id, x, y and z: column `id` of the matrix. The ids are 0 to N - 1,
/// each once, in any order; without the column they are the rows' order. Lengths are in `unit_m` metres; without it the names
/// x_mm, x_cm, x_in state the unit, and plain ones metres. Throws IoError / FormatError, also for fewer than 4 points.
Eigen::Matrix3Xd ReadBoardPoints(const std::string& path, std::optional<double> unit_m);

}  // namespace mvstudio::calib
