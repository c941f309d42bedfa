// Private: HDF5's types, for the .cc files of this folder.
#pragma once

#include <string>

#include "dataset/arrays/foreign_hdf5.h"
#include "dataset/trackers/tracker_file.h"

/// One reader for each layout; errors as in ReadTrackerFile.
namespace mvstudio::dataset::internal {

/// DeepLabCut: a pandas table with the header rows scorer, (individuals,) bodyparts, coords. Its documentation on GitHub,
/// docs/HelperFunctions.md and docs/convert_maDLC.md, names the rows; the first column is the frame, or of labelled images
/// their names.
TrackedPoints ReadDeepLabCutCsv(const std::string& path, const std::string& camera);

/// The same table as pandas' HDFStore keeps it, format "table" (analyze_videos, anipose) or "fixed" (pandas/io/pytables.py):
/// the one group of the file with an attribute `pandas_type`, or of several `df_with_missing`.
TrackedPoints ReadDeepLabCutHdf5(const ForeignHdf5& file, const std::string& camera);

/// SLEAP: datasets `tracks`, `node_names`, `track_names`, `point_scores`. The axes of `tracks` are those of its attribute
/// `dims`, else (track, xy, node, frame), or (frame, node, xy, track) of files written without the transposition for MATLAB
/// (sleap/info/write_tracking_h5.py, sleap_io/io/analysis_h5.py).
TrackedPoints ReadSleapHdf5(const ForeignHdf5& file, const std::string& camera);

/// A row a frame, for one person: columns NAME_x, NAME_y and perhaps NAME_score (or another word for it) of each joint, and
/// `frame`; without it rows count from 0.
TrackedPoints ReadWideCsv(const std::string& path, const std::string& camera);
/// True for the first line of such a table.
bool IsWideCsvHeader(std::string_view line);

/// A row a point: a frame or a time, a joint's name (or number: MediaPipe's 33 by theirs, others are called point_<number>), x,
/// y and perhaps person and score; no camera.
TrackedPoints ReadLongCsv(const std::string& path, const std::string& camera);
bool IsLongCsvHeader(std::string_view line);

/// Whether all joints of such a header end in a camera, of several: DLTdv's pt1_cam1_X, Argus' nose_cam_1_x.
bool NamesSeveralCameras(std::string_view line);

/// SLEAP: columns track, frame_idx, instance.score and NODE.x, NODE.y, NODE.score.
TrackedPoints ReadSleapCsv(const std::string& path, const std::string& camera);

/// NumPy's .npy or .npz by its first bytes.
bool IsPointArray(std::string_view head);
/// One camera's array, see ReadPointArrays.
TrackedPoints ReadPointArray(const std::string& path, const std::string& camera);

}  // namespace mvstudio::dataset::internal
