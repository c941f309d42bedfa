#pragma once

#include <string>

#include "calib/calibrate.h"

/// Where the boards were.
namespace mvstudio::stages {

/// In a calibration's output folder.
inline constexpr char kBoardPosesFile[] = "board_poses.csv";

/// frame,board,x_m,y_m,z_m,qx,qy,qz,qw,num_cameras,num_corners,rms_px: world_from_board of every board in every time step in
/// which it was seen, by frame and board; `board` counts from 0 in the order of the boards. The last three are of the corners
/// that were kept. Empty where the cameras have no common world (lenses alone).
std::string BoardPosesCsv(const calib::CalibrateReport& report);

}  // namespace mvstudio::stages
