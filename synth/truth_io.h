#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"
#include "geometry/rigid/rigid3.h"
#include "synth/studio.h"

namespace mvstudio::synth {

/// Writes mvstudio.toml beside the recorded footage: units, cameras, board, takes, frame rate.
void WriteSessionToml(const SynthOptions& options, const geometry::Rig& rig, const std::string& path);

/// Writes truth/board_poses.json: world_from_board of every frame of the board footage.
void WriteBoardPoses(const calib::Board& board, const std::vector<geometry::Rigid3>& world_from_board, const std::string& path);

/// Adds the joints (3, J) of one frame as exact rows.
void AppendTruth(int frame_idx, const std::vector<std::string>& names, const Eigen::Matrix3Xd& joints_in_world,
                 dataset::Pose3d* pose);

}  // namespace mvstudio::synth
