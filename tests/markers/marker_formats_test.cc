#include <cmath>
#include <fstream>
#include <map>

#include "core/error.h"
#include "core/random.h"
#include "dataset/markers/bvh.h"
#include "dataset/markers/marker_files.h"
#include "dataset/pose/markers.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// What one format writes, another command reads.
namespace mvstudio::markers {
namespace {

MarkerTake SomeTake() {
  MarkerTake take;
  take.rate_hz = 60, take.first_frame = 12, take.names = {"RKnee", "LToe", "Head"};
  Rng rng(8);
  for (int i = 0; i < 3 * 20; ++i) {
    const bool missing = i == 4 || i == 59, filled = i == 7;
    take.x_in_world.push_back(missing ? Eigen::Vector3d(Eigen::Vector3d::Constant(std::nan("")))
                                      : Eigen::Vector3d(rng.Normal(), rng.Normal(), 1 + rng.Normal()));
    take.source.push_back(missing ? Source::kMissing : filled ? Source::kFilled : Source::kMeasured);
    take.sigma_m.push_back(missing || filled ? 0 : 0.002);
  }
  return take;
}

std::string Put(const TempDir& folder, const std::string& name, const std::string& bytes) {
  std::ofstream(folder / name, std::ios::binary) << bytes;
  return folder / name;
}

/// Largest distance between the take and the file's points; infinite where they have other points, or frames.
double Distance(const MarkerTake& take, const dataset::MarkerFile& file) {
  std::map<std::pair<int, std::string>, Eigen::Vector3d> points;
  for (const dataset::JointRow& row : file.pose.rows) {
    if (row.status == Status::kOk) points[{row.frame, row.joint}] = row.x_in_world;
  }
  double largest = 0;
  size_t count = 0;
  for (int f = 0; f < take.num_frames(); ++f) {
    for (int m = 0; m < take.num_markers(); ++m) {
      const size_t i = take.Index(f, m);
      if (take.source[i] == Source::kMissing) continue;
      ++count;
      const auto found = points.find({take.first_frame + f, take.names[static_cast<size_t>(m)]});
      if (found == points.end()) return INFINITY;
      largest = std::max(largest, (found->second - take.x_in_world[i]).norm());
    }
  }
  return count == points.size() ? largest : INFINITY;
}

TEST(MarkerFormats, GiveBackWhatTheyHoldWithUnitAxesAndRate) {
  const TempDir folder;
  const MarkerTake take = SomeTake();
  struct Case {
    std::string name, bytes, unit, up;
    double tolerance_m;
  };
  const Case cases[] = {{"a.trc", TrcText(take, "a.trc"), "mm", "y", 1e-12},
                        {"b.trc", TrcText(take, "b.trc", TrcUnit::kMetre), "m", "y", 1e-12},
                        {"a.c3d", C3dBytes(take), "mm", "z", 1e-6},
                        {"b.c3d", C3dBytes(take, "y"), "mm", "y", 1e-6},
                        {"long.csv", CsvText(take), "m", "z", 0},
                        {"wide.csv", WideCsvText(take), "m", "z", 0},
                        {"wide_mm.csv", WideCsvText(take, {"mm", "z"}), "mm", "z", 1e-12},
                        {"a.sto", StoText(take), "m", "y", 0},
                        {"b.sto", StoText(take, {"cm", "y"}), "cm", "y", 1e-12},
                        {"a.npz", NpzBytes(take), "m", "z", 0},
                        {"b.npz", NpzBytes(take, {"in", "z"}), "in", "z", 1e-12}};
  for (const Case& c : cases) {
    const dataset::MarkerFile file = dataset::ReadMarkers(Put(folder, c.name, c.bytes));
    EXPECT_LE(Distance(take, file), c.tolerance_m) << c.name;
    EXPECT_EQ(file.unit, c.unit) << c.name;
    EXPECT_EQ(file.y_up, c.up == "y") << c.name;
    EXPECT_NEAR(file.pose.frame_rate_hz, 60, 1e-4) << c.name;
  }
  const dataset::MarkerFile arrays = dataset::ReadMarkers(folder / "a.npz"), table = dataset::ReadMarkers(folder / "long.csv");
  for (const dataset::MarkerFile* file : {&arrays, &table}) {
    for (const dataset::JointRow& row : file->pose.rows) {
      if (row.status != Status::kOk) continue;
      const bool filled = row.frame == 14 && row.joint == "LToe";  // the seventh position
      EXPECT_EQ(row.num_views == 0, filled) << row.frame << row.joint;
      EXPECT_EQ(row.sigma_m, filled ? 0 : 0.002);
    }
  }
}

TEST(MarkerFormats, UnitAndAxisMayBeSaidInsteadOfTheFile) {
  const TempDir folder;
  const MarkerTake take = SomeTake();
  const std::string z_up = Put(folder, "z.sto", StoText(take, {"m", "z"}));
  EXPECT_GT(Distance(take, dataset::ReadMarkers(z_up)), 0.1);
  EXPECT_EQ(Distance(take, dataset::ReadMarkers(z_up, "", "z")), 0);
  const std::string x_up = Put(folder, "x.csv", WideCsvText(take, {"m", "x"}));
  EXPECT_EQ(Distance(take, dataset::ReadMarkers(x_up, "", "x")), 0);
  const std::string named = Put(folder, "n.csv", "Frame,Time,a.X,a.Y,a.Z,score\n1,0.0,1,2,3,9\n2,0.5,1,,3,9\n");
  EXPECT_THROW(dataset::ReadMarkers(named), FormatError) << "it states no unit";
  const dataset::MarkerFile file = dataset::ReadMarkers(named, "cm");
  ASSERT_EQ(file.pose.rows.size(), 2u);
  EXPECT_EQ(file.pose.rows[0].x_in_world, Eigen::Vector3d(0.01, 0.02, 0.03));
  EXPECT_NE(file.pose.rows[1].status, Status::kOk);
  EXPECT_EQ(file.pose.frame_rate_hz, 2);
  EXPECT_THAT(file.notes.at(0), HasSubstr("score"));
  EXPECT_THROW(dataset::ReadMarkers(named, "cm", "w"), UsageError);
  EXPECT_THROW(dataset::ReadMarkers(Put(folder, "m.csv", "frame,a_x_mm,a_y_m,a_z_m\n0,1,2,3\n")), FormatError);
  EXPECT_THROW(dataset::ReadMarkers(Put(folder, "a.sto", "Coordinates\nendheader\ntime\tknee\n0\t1\n"), "m"), FormatError);
  EXPECT_THROW(dataset::ReadMarkers(Put(folder, "a.txt", "x")), FormatError);
}

/// A root that turns by 90 degrees about y and an arm that lifts.
constexpr char kBvh[] =
    "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation\n"
    "JOINT Arm\n{\nOFFSET 10 20 30\nCHANNELS 3 Zrotation Xrotation Yrotation\nJOINT Hand\n{\nOFFSET 5 0 0\n"
    "CHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 1 0 0\n}\n}\n}\n}\n"
    "MOTION\nFrames: 2\nFrame Time: 0.0333333\n"
    "100 90 0 0 0 0 0 0 0 0 0 0\n100 90 0 90 0 0 90 0 0 0 0 0\n";

TEST(MarkerFormats, BvhGivesJointsByForwardKinematics) {
  const TempDir folder;
  const dataset::MarkerFile file = dataset::ReadMarkers(Put(folder, "a.bvh", kBvh));
  EXPECT_EQ(file.pose.frame_rate_hz, 30);
  ASSERT_EQ(file.pose.rows.size(), 6u);
  const auto is = [&](size_t row, double x, double y, double z) {  // of the file, cm, y up
    EXPECT_LT((file.pose.rows[row].x_in_world - Eigen::Vector3d(x, -z, y) / 100).norm(), 1e-12) << row;
  };
  is(0, 100, 90, 0), is(1, 110, 110, 30), is(2, 115, 110, 30);
  // Ry(90) takes x to -z and z to x; the arm's Rz(90) takes x to y.
  is(3, 100, 90, 0), is(4, 130, 110, -10), is(5, 130, 115, -10);
  ASSERT_TRUE(file.pose.definition);
  EXPECT_EQ(file.pose.definition->parents, (std::vector<int>{-1, 0, 1}));
  // Written again with its own hierarchy, it gives the same places.
  const MarkerTake take = MarkersOf(file.pose, 30).at(0);
  const BvhMotion motion = FitBvh(take, *file.pose.definition);
  EXPECT_LT(motion.max_m, 1e-9);
  const dataset::MarkerFile again = dataset::ReadMarkers(Put(folder, "b.bvh", BvhText(motion, *file.pose.definition, 30)));
  EXPECT_LT(Distance(take, again), 1e-9);
}

TEST(MarkerFormats, APointsTableOrItsHeadIsTheRun) {
  const TempDir folder;
  dataset::Pose3d pose{"points", {}};
  dataset::JointRow row;
  row.joint = "snout", row.status = Status::kOk, row.x_in_world = {1, 2, 3}, row.num_views = 2;
  pose.rows = {row}, pose.frame_rate_hz = 59.94;
  dataset::WritePose3d(pose, folder / "run/pose3d");
  for (const char* path : {"run/pose3d", "run/pose3d/points.csv", "run/pose3d/pose3d.json", "run"}) {
    const dataset::Pose3d back = dataset::ReadPoints3d(folder / path);
    ASSERT_EQ(back.rows.size(), 1u) << path;
    EXPECT_EQ(back.frame_rate_hz, 59.94) << path;
  }
}

}  // namespace
}  // namespace mvstudio::markers
