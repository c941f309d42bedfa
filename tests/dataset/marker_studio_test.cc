#include <fstream>

#include "core/error.h"
#include "dataset/pose/markers.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Tables that the programs of motion capture studios export. The numbers are the oracle: each file holds the same two points,
/// whose places in the world are written out here.
namespace mvstudio::dataset {
namespace {

class StudioTables : public ::testing::Test {
 protected:
  MarkerFile Read(const std::string& name, const std::string& text, const std::string& unit = {}) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return ReadMarkers(folder_ / name, unit);
  }
  std::string Message(const std::string& name, const std::string& text) const {
    return MessageOf<FormatError>([&] { Read(name, text); });
  }
  /// Two frames of LASI at (1, 2, 0.9) and (1.1, 2, 0.9) m, and RASI at (1, 2.25, 0.9) m, which the second frame lacks.
  static void ExpectPoints(const MarkerFile& file) {
    ASSERT_EQ(file.pose.rows.size(), 4u);
    EXPECT_EQ(file.pose.rows[0].joint, "LASI");
    EXPECT_EQ(file.pose.rows[0].frame, 0);
    EXPECT_LT((file.pose.rows[0].x_in_world - Eigen::Vector3d(1, 2, 0.9)).norm(), 1e-9);
    EXPECT_EQ(file.pose.rows[1].joint, "RASI");
    EXPECT_LT((file.pose.rows[1].x_in_world - Eigen::Vector3d(1, 2.25, 0.9)).norm(), 1e-9);
    EXPECT_EQ(file.pose.rows[2].frame, 1);
    EXPECT_LT((file.pose.rows[2].x_in_world - Eigen::Vector3d(1.1, 2, 0.9)).norm(), 1e-9);
    EXPECT_NE(file.pose.rows[3].status, Status::kOk);
  }
  testing::TempDir folder_;
};

constexpr char kTrajectories[] =
    "Trajectories\n100\n,,Anna:LASI,,,Anna:RASI,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
    "1,0,1000,2000,900,1000,2250,900\n2,0,1100,2000,900,,,\n";

TEST_F(StudioTables, ViconsTrajectoriesAreReadBehindOtherSections) {
  const std::string devices = "Devices\n1000\n,,Force\nFrame,Sub Frame,Fx\n,,N\n1,0,12\n1,1,13\n\n";
  const MarkerFile file = Read("walk.csv", devices + kTrajectories + "\nModel Outputs\n100\n,,Anna:LKneeAngles,,\n");
  ExpectPoints(file);
  EXPECT_EQ(file.pose.frame_rate_hz, 100);
  EXPECT_EQ(file.unit, "mm");
  EXPECT_FALSE(file.y_up);
  EXPECT_THAT(Message("devices.csv", devices), HasSubstr("without a section `Trajectories`"));
}

TEST_F(StudioTables, SpeedsBehindThePlacesOfViconAreNoPoints) {
  std::string text = kTrajectories;
  text.replace(text.find("Frame,Sub Frame,X,Y,Z,X,Y,Z"), 27, "Frame,Sub Frame,X,Y,Z,X',Y',Z'");
  EXPECT_EQ(Read("walk.csv", text).pose.rows.size(), 2u);
}

TEST_F(StudioTables, MotivesMarkersAreReadAndNotTheirRigidBody) {
  const MarkerFile file =
      Read("take.csv",
           "Format Version,1.23,Take Name,walk,Export Frame Rate,120.000000,Total Exported Frames,3,Length Units,Meters\n\n"
           ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker,Marker,Marker,Marker\n"
           ",Name,Hip,Hip,Hip,Hip,A:LASI,A:LASI,A:LASI,A:RASI,A:RASI,A:RASI\n,ID,1,1,1,1,2,2,2,3,3,3\n"
           ",,Rotation,Position,Position,Position,Position,Position,Position,Position,Position,Position\n"
           "Frame,Time (Seconds),X,X,Y,Z,X,Y,Z,X,Y,Z\n"
           "0,0.000000,0,7,7,7,2,0.9,1,2.25,0.9,1\n1,0.008333,0,7,7,7,2,0.9,1.1,,,\n");
  ExpectPoints(file);
  EXPECT_EQ(file.pose.frame_rate_hz, 120);
  EXPECT_TRUE(file.y_up);
  EXPECT_THAT(file.notes, ::testing::ElementsAre(HasSubstr("Rigid Body"), HasSubstr("states 3 frames, 2 are there")));
}

TEST_F(StudioTables, QualisysIsMillimetresWithAndWithoutFrameNumbers) {
  const std::string head =
      "NO_OF_FRAMES\t2\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t2\nFREQUENCY\t200\nDATA_INCLUDED\t3D\nMARKER_NAMES\tLASI\tRASI\n";
  const std::string rows[] = {"1000\t2000\t900\t1000\t2250\t900\n", "1100\t2000\t900\t0.000\t0.000\t0.000\n"};
  const MarkerFile bare = Read("bare.tsv", head + rows[0] + rows[1]);
  ExpectPoints(bare);
  EXPECT_EQ(bare.pose.frame_rate_hz, 200);
  ExpectPoints(
      Read("full.tsv", head +
                           "TRAJECTORY_TYPES\tMeasured\tMeasured\nFrame\tTime\tLASI X\tLASI Y\tLASI Z\tRASI X\tRASI Y\t"
                           "RASI Z\n1\t0.00000\t" +
                           rows[0] + "2\t0.00500\t" + rows[1]));
  EXPECT_THAT(Message("six.tsv", "NO_OF_FRAMES\t2\nDATA_INCLUDED\t6D\n"), HasSubstr("export the 3D data"));
}

TEST_F(StudioTables, ATableWithoutFramesOrWithTextIsRefusedByLine) {
  std::string text = kTrajectories;
  text.replace(text.find("2250"), 4, "2,2k");
  EXPECT_THAT(Message("walk.csv", text), HasSubstr("line 6"));
  text = kTrajectories;
  text.replace(text.find("2250"), 4, "2250,5");
  EXPECT_THAT(Message("walk.csv", text), AllOf(HasSubstr("line 6"), HasSubstr("decimal points")));
  EXPECT_THAT(Message("walk.csv", std::string(kTrajectories).substr(0, text.find("\n1,0") + 1)), HasSubstr("no frames"));
}

TEST_F(StudioTables, FilesThatHoldNoPlacesNameWhatToGive) {
  EXPECT_THAT(Message("freemocap_data.parquet", "PAR1"), HasSubstr("by_trajectory.csv"));
  EXPECT_THAT(Message("ik.mot", "Coordinates\n"), HasSubstr("joint angles"));
}

TEST_F(StudioTables, AMarkerThatIsAlwaysZeroIsNotSeen) {
  const auto table = [](const std::string& first, const std::string& second) {
    return "frame,a_x_m,a_y_m,a_z_m,b_x_m,b_y_m,b_z_m,c_x_m,c_y_m,c_z_m\n0,0,0,0," + first + "\n1,0,0,0," + second + "\n";
  };
  const MarkerFile walk = Read("walk.csv", table("1,2,0.9,1,2.2,1", "1.1,2,0.9,1.1,2.2,1"));
  EXPECT_NE(walk.pose.rows[0].status, Status::kOk);
  EXPECT_EQ(walk.pose.rows[1].status, Status::kOk);
  EXPECT_THAT(walk.notes, ::testing::Contains(AllOf(HasSubstr("all frames"), HasSubstr("a"))));
  const std::string both = table("1,2,0.9,1,2.2,1", "");
  const MarkerFile survey = Read("survey.csv", both.substr(0, both.rfind("\n1,") + 1));
  EXPECT_EQ(survey.pose.rows[0].status, Status::kOk) << "marks on the floor, their origin among them";
  const MarkerFile relative = Read("relative.csv", table("0.1,0.2,-0.9,-0.1,-0.2,1", "0.1,0.3,-0.9,-0.1,-0.3,1"));
  EXPECT_EQ(relative.pose.rows[0].status, Status::kOk) << "the others lie about it: points relative to a";
}

}  // namespace
}  // namespace mvstudio::dataset
