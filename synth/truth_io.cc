#include "synth/truth_io.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "dataset/session/session_scan.h"

namespace mvstudio::synth {

void WriteSessionToml(const SynthOptions& options, const geometry::Rig& rig, const std::string& path) {
  dataset::Session session;
  session.folder = std::filesystem::path(path).parent_path().string();
  session.units = "m";
  session.source = "synthetic studio";
  session.board = options.board;
  session.fps_hz = options.fps;
  for (const geometry::RigCamera& c : rig.cameras) {
    session.cameras.push_back({c.camera.name, "", "", c.camera.width_px, c.camera.height_px});
  }
  const dataset::ScannedSession scanned = dataset::ScanSession(session.folder);
  session.takes = scanned.takes;
  dataset::WriteSession(session);
}

void WriteBoardPoses(const calib::Board& board, const std::vector<geometry::Rigid3>& world_from_board,
                     const std::string& path) {
  nlohmann::ordered_json root = {
      {"schema", "mvstudio.board_poses/1"}, {"board", calib::ToString(board)}, {"frames", nlohmann::ordered_json::array()}};
  for (size_t i = 0; i < world_from_board.size(); ++i) {
    const geometry::Rigid3& pose = world_from_board[i];
    const Eigen::Vector4d q = pose.rotation.coeffs();
    root["frames"].push_back({{"frame", i},
                              {"world_from_board",
                               {{"rotation_xyzw", {q[0], q[1], q[2], q[3]}},
                                {"translation_m", {pose.translation[0], pose.translation[1], pose.translation[2]}}}}});
  }
  WriteFileAtomic(path, root.dump(1) + "\n");
}

void AppendTruth(int frame_idx, const std::vector<std::string>& names, const Eigen::Matrix3Xd& joints_in_world,
                 dataset::Pose3d* pose) {
  for (size_t j = 0; j < names.size(); ++j) {
    dataset::JointRow row;
    row.frame = frame_idx;
    row.joint = names[j];
    row.status = Status::kOk;
    row.x_in_world = joints_in_world.col(j);
    pose->rows.push_back(row);
  }
}

}  // namespace mvstudio::synth
