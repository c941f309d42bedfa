#include <fcntl.h>
#include <hdf5.h>
#include <sys/file.h>
#include <unistd.h>

#include <fstream>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/error.h"
#include "dataset/arrays/hdf5_writer.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/trackers/support.h"

/// SLEAP's analysis files. The samples follow write_tracking_h5.py and analysis_h5.py, written by h5py.
namespace mvstudio::dataset {
namespace {

using ::testing::Pair;

TEST(Sleap, TracksBecomePeopleAndEdgesBones) {
  const TrackedPoints points = ReadTrackerFile(Sample("tracker_hdf5/sleap.h5"), "top");
  EXPECT_EQ(points.program, "SLEAP");
  EXPECT_THAT(points.joints, ElementsAre("nose", "neck", "tail"));
  EXPECT_THAT(points.individuals, ElementsAre("mouse 1", "mouse 2"));
  EXPECT_THAT(points.bones, ElementsAre(Pair("nose", "neck"), Pair("neck", "tail")));
  ASSERT_EQ(points.track.frames.size(), 4u);
  EXPECT_EQ(points.track.frames.at(0)[0].keypoints[0].x_px, 78.48);
  EXPECT_EQ(points.track.frames.at(0)[1].keypoints[2].y_px, 45.02);
  EXPECT_EQ(points.track.frames.at(0)[1].keypoints[2].score, 0.85);
  EXPECT_EQ(points.track.frames.at(1).size(), 1u);                // mouse 1 is not there
  EXPECT_EQ(points.track.frames.at(2)[1].keypoints[1].score, 0);  // a node that was not found
}

TEST(Sleap, EveryOrderOfTheAxesGivesTheSame) {
  const TrackedPoints matlab = ReadTrackerFile(Sample("tracker_hdf5/sleap.h5"), "a");
  for (const char* name : {"tracker_hdf5/sleap_plain.h5", "tracker_hdf5/sleap_standard.h5", "sleap_csv/two.csv"}) {
    SCOPED_TRACE(name);
    ExpectSame(matlab, ReadTrackerFile(Sample(name), "a"), 1e-12);
  }
}

/// A file of one track, two nodes and two frames; points of frame f, node n: (10 f + n, 5).
std::string Write(const TempDir& folder, const std::vector<uint64_t>& dims, const std::vector<uint64_t>& score_dims,
                  const std::vector<std::string>& nodes) {
  const std::string path = folder / "s.h5";
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const auto put = [&](const char* name, hid_t type, const std::vector<uint64_t>& size, const void* data) {
    const std::vector<hsize_t> hsize(size.begin(), size.end());
    const hid_t space = H5Screate_simple(static_cast<int>(hsize.size()), hsize.data(), nullptr);
    const hid_t set = H5Dcreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data);
    H5Dclose(set), H5Sclose(space);
  };
  const std::vector<double> tracks = {0, 10, 1, 11, 5, 5, 5, 5}, scores(4, 0.5);
  put("tracks", H5T_NATIVE_DOUBLE, dims, tracks.data());
  put("point_scores", H5T_NATIVE_DOUBLE, score_dims, scores.data());
  const hid_t text = H5Tcopy(H5T_C_S1);
  H5Tset_size(text, H5T_VARIABLE);
  std::vector<const char*> names;
  for (const std::string& node : nodes) names.push_back(node.c_str());
  put("node_names", text, {names.size()}, names.data());
  H5Tclose(text), H5Fclose(file);
  return path;
}

TEST(Sleap, OneAnimalWithoutTracks) {
  const TempDir folder;
  const TrackedPoints points = ReadTrackerFile(Write(folder, {1, 2, 2, 2}, {1, 2, 2}, {"a", "b"}), "c");
  EXPECT_THAT(points.individuals, ElementsAre(""));
  EXPECT_EQ(points.track.frames.at(1)[0].keypoints[1].x_px, 11);
  EXPECT_EQ(points.track.frames.at(1)[0].keypoints[1].score, 0.5);
  EXPECT_THAT(points.bones, IsEmpty());
}

TEST(Sleap, WhatDoesNotFitIsNamed) {
  const TempDir folder;
  const auto message = [&](const std::vector<uint64_t>& dims, const std::vector<uint64_t>& scores,
                           const std::vector<std::string>& nodes) {
    const std::string path = Write(folder, dims, scores, nodes);
    return MessageOf<FormatError>([&] { ReadTrackerFile(path, "c"); });
  };
  EXPECT_THAT(message({1, 2, 2, 2}, {1, 2, 2}, {"a", "b", "c"}), AllOf(HasSubstr("/tracks"), HasSubstr("1 x 2 x 2 x 2")));
  EXPECT_THAT(message({2, 2, 2}, {1, 2, 2}, {"a", "b"}), HasSubstr("3 dimensions instead of 4"));
  EXPECT_THAT(message({1, 2, 2, 2}, {1, 2, 1}, {"a", "b"}), HasSubstr("/point_scores"));
  EXPECT_THAT(message({1, 2, 2, 2}, {1, 2, 2}, {"a", "a"}), HasSubstr("`a` twice"));
  EXPECT_THAT(message({1, 2, 2, 2}, {1, 2, 2}, {"a", "b\n"}), HasSubstr("control character"));
}

TEST(Sleap, AFileThatAnotherProgramWritesIsInUse) {
  const TempDir folder;
  const std::string path = Write(folder, {1, 2, 2, 2}, {1, 2, 2}, {"a", "b"});
  const int other = open(path.c_str(), O_RDWR);
  flock(other, LOCK_EX);
  EXPECT_THROW(ReadTrackerFile(path, "c"), LockedError);
  close(other);
  EXPECT_EQ(ReadTrackerFile(path, "c").track.frames.size(), 2u);
}

/// Gzipped zeros: 300 MB in some hundred kilobytes.
TEST(Sleap, WhatIsOutOfAllProportionIsNotUnpacked) {
  const TempDir folder;
  const std::string path = Write(folder, {1, 2, 2, 2}, {1, 2, 2}, {"a", "b"});
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hsize_t dims[] = {1, 2, 2, 10'000'000}, chunk[] = {1, 2, 2, 1'000'000};
  const hid_t space = H5Screate_simple(4, dims, nullptr), packed = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(packed, 4, chunk), H5Pset_deflate(packed, 9);
  H5Ldelete(file, "tracks", H5P_DEFAULT);
  const hid_t set = H5Dcreate2(file, "tracks", H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, packed, H5P_DEFAULT);
  const std::vector<double> zeros(40'000'000, 0.0);
  H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, zeros.data());
  H5Dclose(set), H5Pclose(packed), H5Sclose(space);
  H5Ldelete(file, "point_scores", H5P_DEFAULT);
  H5Fclose(file);
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadTrackerFile(path, "c"); }), HasSubstr("out of all proportion"));
}

TEST(Sleap, TablesOfTextNameWhatIsWrong) {
  const TempDir folder;
  const auto read = [&](const std::string& text) {
    std::ofstream(folder / "a.csv") << text;
    return ReadTrackerFile(folder / "a.csv", "c");
  };
  const auto message = [&](const std::string& text) { return MessageOf<FormatError>([&] { read(text); }); };
  const std::string head = "track,frame_idx,instance.score,n.x,n.y,n.score\n";
  EXPECT_THAT(message("track,frame_idx,n.x\n"), HasSubstr("`n` has no column"));
  EXPECT_THAT(message("track,frame_idx\n"), HasSubstr("no column holds a node's x"));
  EXPECT_THAT(message(head), HasSubstr("holds no frame"));
  const TrackedPoints points = read(head + ",3,1,1,2,0.5\n,3,1,4,5,0.5\nt,3,1,6,7,1\nt,3,1,8,9,1\n,x,1,1,2,1\n,4,1,,,\n");
  EXPECT_EQ(points.track.frames.at(3).size(), 3u);  // two without a track and one of track t
  EXPECT_THAT(points.track.frames.at(4), IsEmpty());
  EXPECT_THAT(points.track.skipped, ElementsAre(HasSubstr("two rows for frame 3"), HasSubstr("`x`")));
}

TEST(Trackers, JointsOfSeveralCamerasAreUnited) {
  std::vector<TrackedPoints> cameras(2);
  cameras[0].joints = {"nose", "tail"}, cameras[1].joints = {"tail", "ear"};
  cameras[1].track.camera = "b", cameras[1].program = "SLEAP";
  cameras[1].track.frames[4] = {{{{1, 2, 1}, {3, 4, 0.5}}}};
  EXPECT_THAT(UnitedJoints(cameras), ElementsAre("nose", "tail", "ear"));
  const std::vector<Pose2dTrack> tracks = ToSkeleton(cameras, geometry::PointsSkeleton(UnitedJoints(cameras)));
  const std::vector<Keypoint2d>& keypoints = tracks[1].frames.at(4)[0].keypoints;
  ASSERT_EQ(keypoints.size(), 3u);
  EXPECT_EQ(keypoints[0].score, 0);
  EXPECT_EQ(keypoints[1].x_px, 1);
  EXPECT_EQ(keypoints[2].score, 0.5);
  EXPECT_THAT(MessageOf<FormatError>([&] {
                ToSkeleton(cameras, geometry::PointsSkeleton({"nose", "tail"}));
              }),
              AllOf(HasSubstr("camera b"), HasSubstr("SLEAP file: joint `ear`")));
}

TEST(Caliscope, APointThatStandsThereTwiceIsNoPoint) {
  const TempDir folder;
  WriteFileAtomic(
      folder / "xy.csv",
      "sync_index,cam_id,point_id,img_loc_x,img_loc_y\n0,1,7,10,20\n0,1,8,11,21\n0,1,7,30,40\n1,1,7,12,22\n1,1,7,,\n");
  const Pose2dSet set = ReadCaliscopeCsv(folder / "xy.csv").set;
  EXPECT_EQ(set.tracks.at(0).frames.at(0)[0].keypoints[0].score, 0);
  EXPECT_EQ(set.tracks.at(0).frames.at(0)[0].keypoints[1].x_px, 11);
  EXPECT_EQ(set.tracks.at(0).frames.at(1)[0].keypoints[0].x_px, 12) << "the other row has no place";
  ASSERT_EQ(set.skipped.size(), 1u);
  EXPECT_NE(set.skipped[0].find("camera 1, time step 0: point 7 stands there twice"), std::string::npos) << set.skipped[0];
}

TEST(Caliscope, CamerasAndPointsGoByTheirNumbers) {
  const CaliscopePoints points = ReadCaliscopeCsv(Sample("caliscope_points/pose.csv"));
  ASSERT_EQ(points.set.tracks.size(), 2u);
  EXPECT_EQ(points.set.tracks[1].camera, "cam_2");
  EXPECT_THAT(points.set.skeleton.joints, ElementsAre("point_0", "point_11", "point_40"));
  EXPECT_EQ(points.set.tracks[1].frames.at(2)[0].keypoints[1].x_px, 31.5);
  EXPECT_EQ(points.num_beyond, 0u);
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("mediapipe33");
  const CaliscopePoints named = ReadCaliscopeCsv(Sample("caliscope_points/pose.csv"), &skeleton);
  EXPECT_EQ(named.num_beyond, 6u);  // point 40
  EXPECT_EQ(named.set.tracks[0].frames.at(0)[0].keypoints[11].x_px, 11.5);
}

}  // namespace
}  // namespace mvstudio::dataset
