// Private: for dataset/pose/markers.cc.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dataset/pose/markers.h"

/// 3D joints of FreeMoCap and of DeepLabCut, tables of motion capture studios. `unit` as in ReadMarkers: neither states one.
namespace mvstudio::dataset::internal {

/// DeepLabCut's `*_DLC_3D.h5` and `.csv` (deeplabcut/pose_estimation_3d/triangulation.py): header rows scorer, (individuals,)
/// bodyparts, coords with x, y, z. Individuals become persons. Lengths count squares of the board; the axes are those of the
/// first camera after rectification. Throws FormatError, also for a result of one camera.
MarkerFile ReadDeepLabCutMarkers(const std::string& path, const std::string& unit);
/// True for a CSV with these header rows.
bool IsDeepLabCutTable(std::string_view text);

/// FreeMoCap's arrays of points, (frames, points, 3) float. Names are those of the table beside it with the same name, or of
/// the parts' tables (PROGRAM_body_3d_xyz.csv, then right_hand, left_hand and face) that together have as many points; else
/// of MediaPipe for a file mediapipe*.npy of 33 points (freemocap/core_processes/post_process_skeleton_data/split_and_save.py).
MarkerFile ReadNpyMarkers(const std::string& path, const std::string& unit);
/// `model` (mediapipe_body, rtmpose.left_hand) and `keypoint` of a row as the column of FreeMoCap's other tables without
/// `body_`: nose, left_hand_0003, com_full_body.
std::string FreeMoCapJoint(std::string_view model, std::string_view keypoint);
/// The same for a column's name, `body_nose`.
std::string FreeMoCapJoint(const std::string& column);
/// Frames a second of FreeMoCap's time stamps, whose unit nothing states: s, ms, us and ns give 1 to 1000 a second in one of
/// them alone, which is said in `notes`. 0: there are none, or none of these fits.
double FreeMoCapRate(const std::vector<std::pair<int, double>>& times, std::vector<std::string>* notes);
/// That no file of FreeMoCap states which axis is up.
extern const char kFreeMoCapAxes[];

/// True for a CSV of Vicon Nexus (sections with titles) or OptiTrack Motive (`Format Version`).
bool IsStudioTable(std::string_view text);
/// Such a CSV: Vicon's section Trajectories, z up, frame 1 is frame 0; Motive's markers, else its bones, y up, frames from 0.
MarkerFile ReadStudioTable(const std::string& path, const std::string& unit);
/// Qualisys QTM's .tsv: mm, z up; frame 1 is frame 0 where it numbers its rows.
MarkerFile ReadTsvMarkers(const std::string& path, const std::string& unit);

/// EasyMocap's folder keypoints3d, FRAME.json: a list of {id, keypoints3d}, x, y, z and a confidence of each point; 0: not
/// seen. Points are named by their number, 17, 25, 67 or 137; the face of the last is left out, and noted. Ids become persons.
MarkerFile ReadEasyMocapMarkers(const std::string& folder, const std::string& unit);
/// That folder, itself or in `folder`; empty: it is not there.
std::string FindEasyMocapPoints(const std::string& folder);

/// The file with the 3D joints of a recording of FreeMoCap or of a project of DeepLabCut; empty: the folder is neither. Throws
/// FormatError where several of DeepLabCut's lie there.
std::string FindProgramPoints(const std::string& folder);

}  // namespace mvstudio::dataset::internal
