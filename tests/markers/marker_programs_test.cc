#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/format.h"
#include "dataset/pose/markers.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/trackers/support.h"

/// 3D joints in the layouts of FreeMoCap (data_saver.py, split_and_save.py, skellyforge's actor.py) and of DeepLabCut's
/// triangulation.py, all with the same positions.
namespace mvstudio::dataset {
namespace {

using ::testing::Contains;

constexpr int kFrames = 3;
const std::vector<std::string> kNames = {"nose", "left_hip", "left_hand_0003"};

/// In the file's unit.
double PlaceOf(int frame, size_t point, int axis) { return 100.0 * frame + 10.0 * static_cast<double>(point) + axis + 0.5; }

std::string Put(const TempDir& folder, const std::string& name, const std::string& bytes) {
  std::filesystem::create_directories(std::filesystem::path(folder / name).parent_path());
  std::ofstream(folder / name, std::ios::binary) << bytes;
  return folder / name;
}

/// numpy.save of float64 (frames, points, 3).
std::string NpyOfPlaces(size_t points) {
  std::string head = Format("{'descr': '<f8', 'fortran_order': False, 'shape': (%d, %zu, 3), }", kFrames, points);
  while ((head.size() + 11) % 64 != 0) head += ' ';
  head += '\n';
  std::string bytes =
      std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(head.size() & 255) + static_cast<char>(head.size() >> 8) + head;
  for (int f = 0; f < kFrames; ++f) {
    for (size_t p = 0; p < points; ++p) {
      for (int k = 0; k < 3; ++k) {
        const double value = PlaceOf(f, p, k);
        char raw[8];
        std::memcpy(raw, &value, 8);
        bytes.append(raw, 8);
      }
    }
  }
  return bytes;
}

std::string WideTable(const std::vector<std::string>& names, const std::string& before,
                      const std::vector<std::string>& stamps) {
  std::string text = before;
  for (const std::string& name : names) text += name + "_x," + name + "_y," + name + "_z,";
  text.back() = '\n';
  for (int f = 0; f < kFrames; ++f) {
    if (!before.empty()) text += stamps[static_cast<size_t>(f)] + ",\"{'cam_0': 1, 'cam_1': 2}\",";
    for (size_t p = 0; p < names.size(); ++p) {
      for (int k = 0; k < 3; ++k) text += Format("%.17g,", PlaceOf(f, p, k));
    }
    text.back() = '\n';
  }
  return text;
}

constexpr char kClock[] = "timestamp,timestamp_by_camera,";

void ExpectPlaces(const MarkerFile& file, const std::vector<std::string>& names, double metres) {
  ASSERT_EQ(file.pose.rows.size(), kFrames * names.size());
  EXPECT_FALSE(file.y_up);
  for (size_t i = 0; i < file.pose.rows.size(); ++i) {
    const JointRow& row = file.pose.rows[i];
    const int frame = static_cast<int>(i / names.size());
    const size_t point = i % names.size();
    EXPECT_EQ(row.frame, frame);
    EXPECT_EQ(row.joint, names[point]);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(row.x_in_world[k], metres * PlaceOf(frame, point, k), 1e-12);
  }
}

TEST(FreeMoCapPoints, TablesAndArraysHoldTheSameJoints) {
  const TempDir folder;
  const std::vector<std::string> columns = {"body_nose", "body_left_hip", "left_hand_0003"};
  const std::string wide =
      Put(folder, "take/take_by_trajectory.csv", WideTable(columns, kClock, {"5.00e9", "5.02e9", "5.04e9"}));
  ExpectPlaces(ReadMarkers(wide, "mm"), kNames, 1e-3);
  std::string rows = std::string("frame,") + kClock + "model,keypoint,x,y,z,reprojection_error\n";
  const char* const of_rows[] = {"mediapipe_body,nose", "mediapipe_body,left_hip", "mediapipe_hand,left_0003"};
  std::string tidy = "frame,keypoint,x,y,z,model,trajectory,reprojection_error\n";
  const char* const of_tidy[] = {"nose,%s,rtmpose.body", "left_hip,%s,rtmpose.body", "0003,%s,rtmpose.left_hand"};
  for (int f = 0; f < kFrames; ++f) {
    for (size_t p = 0; p < kNames.size(); ++p) {
      const std::string x = Format("%g,%g,%g", PlaceOf(f, p, 0), PlaceOf(f, p, 1), PlaceOf(f, p, 2));
      rows += Format("%d,,{},%s,%s,0.5\n", f, of_rows[p], x.c_str());
      const std::string line = of_tidy[p];
      const size_t at = line.find("%s");
      const std::string filled = line.substr(0, at) + x + line.substr(at + 2);
      tidy += Format("%d,%s,3d_xyz,\n%d,%s,rigid_3d_xyz,\n", f, filled.c_str(), f, filled.c_str());
    }
  }
  ExpectPlaces(ReadMarkers(Put(folder, "take_by_frame.csv", rows), "mm"), kNames, 1e-3);
  const MarkerFile two = ReadMarkers(Put(folder, "freemocap_data_by_frame.csv", tidy), "mm");
  ExpectPlaces(two, kNames, 1e-3);
  EXPECT_THAT(two.notes, Contains(HasSubstr("rigid_3d_xyz")));
  // An array is named by the table of its name, or by those of the parts.
  Put(folder, "o/mediapipe_body_3d_xyz.csv", WideTable({"body_nose", "body_left_hip"}, "", {}));
  Put(folder, "o/mediapipe_left_hand_3d_xyz.csv", WideTable({"left_hand_0003"}, "", {}));
  ExpectPlaces(ReadMarkers(Put(folder, "o/mediapipe_skeleton_3d.npy", NpyOfPlaces(3)), "mm"), kNames, 1e-3);
  ExpectPlaces(ReadMarkers(Put(folder, "o/mediapipe_body_3d_xyz.npy", NpyOfPlaces(2)), "mm"), {"nose", "left_hip"}, 1e-3);
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMarkers(Put(folder, "o/mediapipe_body_3d_xyz.npy", NpyOfPlaces(3)), "mm"); }),
              HasSubstr("has 3 points"));
  const MarkerFile body = ReadMarkers(Put(folder, "b/mediapipe_body.npy", NpyOfPlaces(33)), "mm");
  EXPECT_EQ(body.pose.rows[23].joint, "LHip");  // number 23 of MediaPipe's landmarks
  EXPECT_THAT(ReadMarkers(Put(folder, "c/points.npy", NpyOfPlaces(2)), "mm").notes, Contains(HasSubstr("point_1")));
}

TEST(FreeMoCapPoints, UnitIsAskedForAndTimesAndAxesAreSaid) {
  const TempDir folder;
  const std::string nanoseconds =
      Put(folder, "take/take_by_trajectory.csv", WideTable({"body_nose"}, kClock, {"5.00e9", "5.02e9", "5.04e9"}));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMarkers(nanoseconds); }), HasSubstr("option 'marker-unit'"));
  MarkerFile file;
  ReadPoints3d(folder / "take", "mm", "", &file);
  EXPECT_NEAR(file.pose.frame_rate_hz, 50, 1e-9);
  EXPECT_THAT(file.notes, Contains(HasSubstr("as ns they are 50 frames a second")));
  EXPECT_THAT(file.notes, Contains(AllOf(HasSubstr("states no axis"), HasSubstr("option 'up'"))));
  EXPECT_THAT(file.notes, Contains(HasSubstr(nanoseconds)));
  for (const std::vector<std::string>& stamps :
       std::vector<std::vector<std::string>>{{"0.10", "0.12", "0.14"}, {"100", "120", "140"}, {"100000", "120000", "140000"}})
    EXPECT_NEAR(ReadMarkers(Put(folder, "s.csv", WideTable({"body_nose"}, kClock, stamps)), "mm").pose.frame_rate_hz, 50, 1e-6);
  for (const char* const stamp : {"", "2024-01-01 12:00:00"})
    EXPECT_EQ(
        ReadMarkers(Put(folder, "s.csv", WideTable({"body_nose"}, kClock, {stamp, stamp, stamp})), "mm").pose.frame_rate_hz, 0);
}

std::string DeepLabCutText() {
  std::string text = "scorer,S,S,S,S,S,S\nbodyparts,nose,nose,nose,tail,tail,tail\ncoords,x,y,z,x,y,z\n";
  for (int f = 0; f < kFrames; ++f) {
    text += std::to_string(f);
    for (size_t p = 0; p < 2; ++p) {
      for (int k = 0; k < 3; ++k) text += Format(",%g", PlaceOf(f, p, k));
    }
    text += '\n';
  }
  return text;
}

TEST(DeepLabCutPoints, CountsSquaresOfTheBoard) {
  const TempDir folder;
  const std::string path = Put(folder, "videos/walk_DLC_3D.csv", DeepLabCutText());
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMarkers(path); }), AllOf(HasSubstr("squares"), HasSubstr("25mm")));
  const MarkerFile file = ReadMarkers(path, "25mm");
  ExpectPlaces(file, {"nose", "tail"}, 0.025);
  EXPECT_EQ(file.pose.frame_rate_hz, 0);
  EXPECT_THAT(file.notes, Contains(HasSubstr("first camera after rectification")));
  Put(folder, "config.yaml", "scorername_3d: DLC_3D # by default\n");
  EXPECT_EQ(PointsFileAt(folder.path()), path);
  Put(folder, "videos/run_DLC_3D.csv", DeepLabCutText());
  EXPECT_THAT(MessageOf<FormatError>([&] { PointsFileAt(folder.path()); }), HasSubstr("several results"));
  const std::string flat = Put(folder, "flat.csv", "scorer,S,S,S\nbodyparts,a,a,a\ncoords,x,y,likelihood\n0,1,2,1\n");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMarkers(flat, "mm"); }), HasSubstr("option 'pose2d'"));
  EXPECT_THROW(ReadMarkers(path, "0mm"), UsageError);
  EXPECT_THROW(ReadMarkers(path, "25"), UsageError);
}

TEST(DeepLabCutPoints, Hdf5OfSeveralAnimals) {
  // By h5py: frame 0, columns 9 to 11, which are the tail of m2, the second individual.
  const MarkerFile file = ReadMarkers(Sample("tracker_hdf5/dlc_3d_table.h5"), "m");
  const auto row = std::find_if(file.pose.rows.begin(), file.pose.rows.end(),
                                [](const JointRow& r) { return r.frame == 0 && r.person == 1 && r.joint == "tail"; });
  ASSERT_NE(row, file.pose.rows.end());
  EXPECT_EQ(row->x_in_world, Eigen::Vector3d(289.101, 45.157, 0.721));
  const auto missing = std::find_if(file.pose.rows.begin(), file.pose.rows.end(),
                                    [](const JointRow& r) { return r.frame == 1 && r.person == 0 && r.joint == "nose"; });
  ASSERT_NE(missing, file.pose.rows.end());
  EXPECT_NE(missing->status, Status::kOk);
  EXPECT_THROW(ReadMarkers(Sample("tracker_hdf5/dlc_two_table.h5"), "m"), FormatError);
}

}  // namespace
}  // namespace mvstudio::dataset
