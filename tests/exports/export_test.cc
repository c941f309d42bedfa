#include "dataset/exports/export.h"

#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <sstream>

#include "core/error.h"
#include "dataset/exports/take.h"
#include "dataset/markers/bvh.h"
#include "dataset/pose/pose3d_trc.h"
#include "tests/exports/fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::exports::testing {
namespace {

namespace fs = std::filesystem;

TEST(SafeNames, HostileNamesBecomeDifferentPlainOnes) {
  const std::vector<std::string> hostile = {
      "cam 1", "cam_1",  "../../etc/passwd",    "..",         "", "\xf0\x9f\x93\xb7", "a\nb", "a/b",
      "-rf",   "caméra", std::string(300, 'x'), "cam\x01\x7f"};
  const std::vector<std::string> safe = SafeNames(hostile);
  EXPECT_EQ(std::set<std::string>(safe.begin(), safe.end()).size(), hostile.size());
  for (const std::string& name : safe) {
    EXPECT_FALSE(name.empty());
    EXPECT_LE(name.size(), 70u);
    EXPECT_EQ(name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-"), std::string::npos)
        << name;
    EXPECT_NE(name[0], '-');
  }
  EXPECT_THAT(SafeNames({"00_00", "Left-2"}), ElementsAre("00_00", "Left-2"));
}

TEST(Num, ReadsBackAsTheSameDouble) {
  for (const double value : {0.0, -0.0, 1.0 / 3, 1e-300, 12345678.90123, -1e17}) {
    EXPECT_EQ(std::strtod(Num(value).c_str(), nullptr), value);
  }
}

TEST(Bvh, AnglesRebuildTheRotation) {
  for (int i = 0; i < 200; ++i) {
    const double b = i < 20 ? (i % 2 ? 90 : -90) : i * 1.7 - 170;
    const Eigen::Matrix3d r =
        (Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(DegToRad(b), Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(-0.07 * i, Eigen::Vector3d::UnitY()))
            .toRotationMatrix();
    const Eigen::Vector3d a = markers::ZxyAngles(r);
    const Eigen::Matrix3d back =
        (Eigen::AngleAxisd(a[0], Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(a[1], Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(a[2], Eigen::Vector3d::UnitY()))
            .toRotationMatrix();
    EXPECT_LT((back - r).norm(), 1e-12) << i;
  }
}

/// One frame a pose; nobody where there is none.
markers::MarkerTake MarkersOfPoses(const std::vector<std::optional<dataset::Coco19Pose>>& poses) {
  markers::MarkerTake take;
  take.rate_hz = 30, take.names = geometry::Coco19().joints;
  for (const auto& pose : poses) {
    for (int j = 0; j < 19; ++j) {
      const bool valid = pose && pose->valid[j];
      take.x_in_world.push_back(valid ? Eigen::Vector3d(pose->x_in_world.col(j)) : Eigen::Vector3d::Constant(std::nan("")));
      take.source.push_back(valid ? markers::Source::kMeasured : markers::Source::kMissing);
    }
  }
  take.sigma_m.assign(take.source.size(), 0);
  return take;
}

TEST(Bvh, FollowsARigidSkeletonExactlyAndHoldsWhatIsMissing) {
  std::vector<std::optional<dataset::Coco19Pose>> poses;
  for (int f = 0; f < 12; ++f) poses.push_back(Person({5, -2, 0}, f, false));
  const markers::BvhMotion motion = FitBvh(MarkersOfPoses(poses), geometry::Coco19());
  EXPECT_LT(motion.max_m, 1e-9);
  EXPECT_EQ(motion.num_joints, 12 * 19);
  // A frame without anybody, a joint never seen.
  poses[5].reset();
  for (auto& pose : poses) {
    if (pose) pose->valid[5] = false;
  }
  const markers::BvhMotion holes = FitBvh(MarkersOfPoses(poses), geometry::Coco19());
  EXPECT_LT(holes.max_m, 1e-9);
  EXPECT_TRUE(holes.frames[5].held);
  EXPECT_EQ(holes.num_held, 1);
  EXPECT_EQ(holes.frames[5].root, holes.frames[4].root);
  EXPECT_TRUE(BvhJoints(holes, holes.frames[3])[5].allFinite());
}

TEST(Bvh, BonesThatChangeTheirLengthAreReported) {
  std::vector<std::optional<dataset::Coco19Pose>> poses;
  for (int f = 0; f < 4; ++f) {
    poses.push_back(Person({0, 0, 0}, f, false));
    poses.back()->x_in_world.col(14).z() -= f % 2 ? 0.02 : 0;
  }
  EXPECT_NEAR(FitBvh(MarkersOfPoses(poses), geometry::Coco19()).max_m, 0.01, 1e-3);
}

TEST(Trc, RoundTripsThroughOurReader) {
  const TempDir folder;
  Setting setting;
  setting.missing_joints = true;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
  ExportDataset(dataset, "trc", folder / "out", {});
  const dataset::Pose3d back = dataset::ReadTrc(folder / "out/test_person0.trc");
  EXPECT_EQ(back.rows.size(), 4u * 19);  // 245 to 248, 247 is empty
  size_t seen = 0;
  for (const dataset::JointRow& row : back.rows) {
    const auto pose = dataset.poses.find(row.frame);
    const int j = geometry::Coco19().Find(row.joint);
    ASSERT_GE(j, 0);
    const bool valid = pose != dataset.poses.end() && pose->second.at(0).valid[j];
    ASSERT_EQ(row.status == Status::kOk, valid);
    if (!valid) continue;
    EXPECT_LT((row.x_in_world - pose->second.at(0).x_in_world.col(j)).norm(), 2e-15);
    ++seen;
  }
  EXPECT_GT(seen, 30u);
}

TEST(Trc, MetresRoundTripAsMillimetresDo) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportOptions options;
  options.trc_unit = markers::TrcUnit::kMetre;
  ExportDataset(dataset, "trc", folder / "m", options);
  ExportDataset(dataset, "trc", folder / "mm", {});
  const auto metres = dataset::ReadTrcMarkers(folder / "m/test_person0.trc"),
             millimetres = dataset::ReadTrcMarkers(folder / "mm/test_person0.trc");
  EXPECT_EQ(metres.unit, "m");
  EXPECT_EQ(millimetres.unit, "mm");
  ASSERT_EQ(metres.pose.rows.size(), millimetres.pose.rows.size());
  int seen = 0;
  for (size_t i = 0; i < metres.pose.rows.size(); ++i) {
    ASSERT_EQ(metres.pose.rows[i].status, millimetres.pose.rows[i].status);
    if (metres.pose.rows[i].status != Status::kOk) continue;
    EXPECT_LT((metres.pose.rows[i].x_in_world - millimetres.pose.rows[i].x_in_world).norm(), 2e-15);
    ++seen;
  }
  EXPECT_EQ(seen, 3 * 19);
  EXPECT_THAT(ReadFile(folder / "m/test_person0.trc"), HasSubstr("\tm\t"));
  EXPECT_THAT(MessageOf<UsageError>([&] { FromString("km", &options.trc_unit); }), HasSubstr("'trc-unit' km"));
}

TEST(Export, LinksTakeNoSpaceAndCopiesAreOnTheirOwn) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  const std::string original = dataset.ImagePath("00_00", 245);
  ExportOptions options;
  options.images = ExportImages::kLink;
  ExportReport report = ExportDataset(dataset, "zju", folder / "linked", options);
  EXPECT_EQ(report.linked, report.images + report.masks);
  EXPECT_TRUE(fs::equivalent(original, folder / "linked/00_00/000245.jpg"));
  report = ExportDataset(dataset, "zju", folder / "copied", {});
  EXPECT_EQ(report.linked, 0);
  EXPECT_FALSE(fs::equivalent(original, folder / "copied/00_00/000245.jpg"));
  EXPECT_EQ(ReadFile(original), ReadFile(folder / "copied/00_00/000245.jpg"));
  options.images = ExportImages::kNone;
  report = ExportDataset(dataset, "zju", folder / "none", options);
  EXPECT_EQ(report.images, 0);
  EXPECT_FALSE(fs::exists(folder / "none/00_00"));
}

TEST(Export, ImagesThatExifTurnsAreWrittenRotated) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  const std::string original = dataset.ImagePath("00_00", 245), jpeg = ReadFile(original);
  // Orientation 3, a half turn, as the only tag of a little-endian directory.
  const std::string exif("Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x03\0\0\0\0\0\0\0", 32);
  WriteFileAtomic(original, jpeg.substr(0, 2) + std::string("\xff\xe1\0\x22", 4) + exif + jpeg.substr(2));
  ASSERT_TRUE(dataset::ReadImageHeader(original).turn.any());
  ExportDataset(dataset, "zju", folder / "out", {});
  const std::string written = folder / "out/00_00/000245.jpg";
  EXPECT_FALSE(dataset::ReadImageHeader(written).turn.any());
  const Image shown = dataset::ReadImage(original), read = dataset::ReadImage(written);
  ASSERT_EQ(read.pixels.size(), shown.pixels.size());
  double difference = 0;
  for (size_t i = 0; i < read.pixels.size(); ++i) difference += std::abs(read.pixels[i] - shown.pixels[i]);
  EXPECT_LT(difference / static_cast<double>(read.pixels.size()), 3);
}

TEST(Export, StudioNamesAreMadeSafeAndTheMappingIsKept) {
  const TempDir folder;
  dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  dataset.aliases = {{"../../evil", "00_00"}, {"front \xf0\x9f\x93\xb7", "00_01"}, {"front ", "00_02"}};
  ExportOptions options;
  options.names = ExportNames::kStudio;
  const ExportReport report = ExportDataset(dataset, "zju", folder / "out", options);
  EXPECT_THAT(report.notes[0].code, "EXP-RENAMED");
  const auto manifest = nlohmann::json::parse(ReadFile(folder / "out/export.json"));
  EXPECT_EQ(manifest["cameras"][0]["studio_name"], "../../evil");
  EXPECT_EQ(manifest["cameras"][0]["name"], "_evil");
  EXPECT_NE(manifest["cameras"][1]["name"], manifest["cameras"][2]["name"]);
  EXPECT_TRUE(fs::exists(folder / "out/_evil/000245.jpg"));
  EXPECT_FALSE(fs::exists(folder.path() + "/../evil"));
  options.cameras = {"front "};
  EXPECT_EQ(ExportDataset(dataset, "zju", folder / "one", options).cameras.at(0).source, "00_02");
}

TEST(Export, RefusesWhatAFormatCannotSay) {
  const TempDir folder;
  Setting setting;
  setting.distorted = true;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
  ExportOptions options;
  options.undistort = ExportUndistort::kNever;
  EXPECT_THAT(MessageOf<UsageError>([&] { ExportDataset(dataset, "actorshq", folder / "out", options); }),
              HasSubstr("camera 00_00: actorshq describes an ideal pinhole, not a lens brown5"));
  EXPECT_FALSE(fs::exists(folder / "out"));
  EXPECT_NO_THROW(ExportDataset(dataset, "zju", folder / "zju", options));
  EXPECT_THAT(MessageOf<UsageError>([&] { ExportDataset(dataset, "zju", folder / "zju", options); }),
              HasSubstr("exists already"));
  EXPECT_THAT(MessageOf<UsageError>([&] { ExportDataset(dataset, "obj", folder / "out", {}); }), HasSubstr("known are colmap"));
  for (const char* format : {"usd", "FBX", "usda", "alembic"}) {
    const std::string said = MessageOf<UsageError>([&] { ExportDataset(dataset, format, folder / "out", {}); });
    EXPECT_THAT(said, HasSubstr("Blender and Unreal read gltf")) << format;
  }
  EXPECT_THAT(MessageOf<UsageError>([&] { ExportDataset(dataset, "3DGS", folder / "out", {}); }),
              HasSubstr("Gaussian splatting read colmap"));
  options = {};
  options.frames = {246, 999};
  EXPECT_THAT(MessageOf<UsageError>([&] { ExportDataset(dataset, "zju", folder / "out", options); }), HasSubstr("frame 999"));
  options = {};
  options.cameras = {"nobody"};
  EXPECT_THAT(MessageOf<UsageError>([&] { ExportDataset(dataset, "zju", folder / "out", options); }), HasSubstr("'nobody'"));
  EXPECT_THAT(MessageOf<UsageError>([&] { FromString("perhaps", &options.undistort); }),
              HasSubstr("'undistort' perhaps: must be one of auto, always, never"));
  EXPECT_THROW(FromString("move", &options.images), UsageError);
  EXPECT_THROW(FromString("mine", &options.names), UsageError);
  for (const auto& entry : fs::directory_iterator(folder.path()))
    EXPECT_EQ(entry.path().filename().string().find(".mvstudio-"), std::string::npos) << entry.path();
}

/// The rows of a points3D.txt: track lengths and colours.
std::vector<std::pair<size_t, std::vector<int>>> PointsOf(const std::string& path) {
  std::vector<std::pair<size_t, std::vector<int>>> points;
  std::istringstream lines(ReadFile(path));
  for (std::string line; std::getline(lines, line);) {
    if (line[0] == '#') continue;
    std::istringstream words(line);
    std::vector<double> w{std::istream_iterator<double>(words), {}};
    points.push_back({(w.size() - 8) / 2, {static_cast<int>(w[4]), static_cast<int>(w[5]), static_cast<int>(w[6])}});
  }
  return points;
}

TEST(Export, ColmapPointsHaveTheMedianColourOfTheCamerasThatSeeThem) {
  const TempDir folder;
  Setting setting;
  setting.cameras = 8;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
  const auto paint = [&](const geometry::RigCamera& camera, uint8_t level) {
    dataset::WriteImage(Image(setting.width, setting.height, 3, level), dataset.ImagePath(camera.camera.name, 245));
  };
  for (const geometry::RigCamera& camera : dataset.rig.cameras) paint(camera, 200);
  paint(dataset.rig.cameras[3], 255);  // glare
  const ExportReport report = ExportDataset(dataset, "colmap", folder / "out", {});
  const auto points = PointsOf(folder / "out/sparse/0/points3D.txt");
  EXPECT_EQ(points.size(), static_cast<size_t>(report.points));
  size_t seen_by_three = 0;
  for (const auto& [track, rgb] : points) {
    ASSERT_GE(track, 2u);
    if (track < 3) continue;
    ++seen_by_three;
    for (const int channel : rgb) ASSERT_NEAR(channel, 200, 1);
  }
  EXPECT_GT(seen_by_three, 5u);
  for (const geometry::RigCamera& camera : dataset.rig.cameras) paint(camera, 255);
  ExportDataset(dataset, "colmap", folder / "white", {});
  for (const auto& [track, rgb] : PointsOf(folder / "white/sparse/0/points3D.txt"))
    ASSERT_THAT(rgb, ElementsAre(255, 255, 255));
}

TEST(Export, ColmapSaysThatSplattingNeedsPinholes) {
  const TempDir folder;
  Setting setting;
  setting.distorted = true;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
  const auto has_note = [](const ExportReport& report) {
    return std::any_of(report.notes.begin(), report.notes.end(), [](const Notice& n) { return n.code == "EXP-LENS"; });
  };
  EXPECT_TRUE(has_note(ExportDataset(dataset, "colmap", folder / "out", {})));
  ExportOptions options;
  options.undistort = ExportUndistort::kAlways;
  EXPECT_FALSE(has_note(ExportDataset(dataset, "colmap", folder / "flat", options)));
}

std::string NoteText(const ExportReport& report, const std::string& code) {
  for (const Notice& note : report.notes) {
    if (note.code == code) return note.text;
  }
  return "";
}

/// The fixture's principal points are up to 2 px off the centres.
TEST(Export, WarnsOfWhatTheReadersOfAFormatCannotHold) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  EXPECT_THAT(NoteText(ExportDataset(dataset, "gltf", folder / "gltf", {}), "EXP-CENTRE"), HasSubstr("Blender's importer"));
  EXPECT_THAT(NoteText(WriteRig(dataset.rig, "gltf", folder / "rig"), "EXP-CENTRE"), HasSubstr("5 cameras"));
  EXPECT_THAT(NoteText(ExportDataset(dataset, "colmap", folder / "colmap", {}), "EXP-CENTRE"), HasSubstr("Gaussian splatting"));
  for (const char* format : {"blender", "nerfstudio", "zju", "npz", "ply"})
    EXPECT_EQ(NoteText(ExportDataset(dataset, format, folder / format, {}), "EXP-CENTRE"), "") << format;
  ExportOptions centred;
  centred.undistort = ExportUndistort::kAlways, centred.undistort_view = dataset::UndistortView::kCentred;
  EXPECT_EQ(NoteText(ExportDataset(dataset, "gltf", folder / "centred", centred), "EXP-CENTRE"), "");
  Setting setting;
  setting.distorted = true;
  const dataset::PanopticDataset brown = MakeDataset(folder / "b", setting);
  EXPECT_THAT(NoteText(ExportDataset(brown, "gltf", folder / "b-gltf", {}), "EXP-LENS"), HasSubstr("leaves out"));
  setting = {};
  setting.cameras = 51, setting.frames = {7}, setting.width = 32, setting.height = 24;
  const dataset::PanopticDataset many = MakeDataset(folder / "m", setting);
  EXPECT_THAT(NoteText(ExportDataset(many, "dynamic3dgs", folder / "m-out", {}), "EXP-CAMERAS"), HasSubstr("room for 50"));
}

TEST(Export, ZjuSaysWhichSizeNeuralBodyMustBeTold) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  EXPECT_THAT(NoteText(ExportDataset(dataset, "zju", folder / "zju", {}), "EXP-SIZE"), HasSubstr("H: 72, W: 96"));
  for (const char* masks : {"mask", "mask_cihp"})
    EXPECT_TRUE(fs::exists(folder / ("zju/" + std::string(masks) + "/00_03/000246.png"))) << masks;
  ExportDataset(dataset, "easymocap", folder / "easymocap", {});
  for (const char* masks : {"mask", "masks"})
    EXPECT_TRUE(fs::exists(folder / ("easymocap/" + std::string(masks) + "/00_03/000246.png"))) << masks;
}

TEST(Export, EasyMocapSaysThatEasyVolcapCountsFromZero) {
  const TempDir folder;
  Setting setting;
  setting.frames = {0, 12, 24}, setting.cameras = 2;
  const dataset::PanopticDataset thinned = MakeDataset(folder / "d", setting);
  EXPECT_THAT(NoteText(ExportDataset(thinned, "easymocap", folder / "a", {}), "EXP-GAPS"), HasSubstr("000001"));
  ExportOptions options;
  options.frames = {12, 24};
  EXPECT_EQ(NoteText(ExportDataset(thinned, "easymocap", folder / "b", options), "EXP-GAPS"), "");
}

/// nerfstudio refuses a file in which some images have a mask and others have none.
TEST(Export, NerfstudioHasAMaskForEveryImageOrForNone) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  fs::remove(dataset.MaskPath("00_02", 245));
  const auto with_mask = [&](const std::string& out) {
    ExportDataset(dataset, "nerfstudio", folder / out, {});
    size_t count = 0;
    const auto frames = nlohmann::json::parse(ReadFile(folder / (out + "/transforms.json")))["frames"];
    for (const auto& frame : frames) {
      count += frame.contains("mask_path");
      EXPECT_TRUE(!frame.contains("mask_path") || fs::exists(folder / (out + "/" + frame["mask_path"].get<std::string>())));
    }
    return count;
  };
  EXPECT_EQ(with_mask("out"), 5u);
  const Image mask = dataset::ReadImage(folder / "out/masks/00_02.png", true);
  EXPECT_EQ(*std::min_element(mask.pixels.begin(), mask.pixels.end()), 255);
  fs::remove_all(dataset.root + "/masks");
  EXPECT_EQ(with_mask("none"), 0u);
}

TEST(Export, NobodyIsBadInputForJointFiles) {
  const TempDir folder;
  Setting setting;
  setting.people = 0;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
  for (const char* format : {"trc", "c3d", "bvh", "csv"}) {
    EXPECT_THROW(ExportDataset(dataset, format, folder / "out", {}), FormatError) << format;
  }
  EXPECT_FALSE(fs::exists(folder / "out"));
}

TEST(Export, DamagedOrMisfitImagesLeaveNothingBehind) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  dataset::WriteImage(Disc(50, 50, false), dataset.ImagePath("00_03", 245));
  EXPECT_THAT(MessageOf<FormatError>([&] { ExportDataset(dataset, "zju", folder / "out", {}); }), HasSubstr("50x50"));
  WriteFileAtomic(dataset.ImagePath("00_03", 245), ReadFile(dataset.ImagePath("00_03", 246)).substr(0, 900));
  for (const char* format : {"zju", "easymocap", "dynamic3dgs", "humman"})
    EXPECT_THAT(MessageOf<FormatError>([&] { ExportDataset(dataset, format, folder / "out", {}); }),
                HasSubstr("00_03_00000245"));
  WriteFileAtomic(dataset.ImagePath("00_03", 245), "no picture");
  EXPECT_THROW(ExportDataset(dataset, "zju", folder / "out", {}), FormatError);
  EXPECT_FALSE(fs::exists(folder / "out"));
}

TEST(Export, MissingImagesAreCounted) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  fs::remove(dataset.ImagePath("00_03", 246));
  fs::remove(dataset.MaskPath("00_02", 245));
  const ExportReport report = ExportDataset(dataset, "dynamic3dgs", folder / "out", {});
  EXPECT_EQ(report.missing_images, 1);
  EXPECT_EQ(report.missing_masks, 1);
  EXPECT_THAT(report.missing.by_camera.at("00_03").no_image, ::testing::ElementsAre(246));
  EXPECT_THAT(report.notes.at(report.notes.size() - 2).text, HasSubstr("(00_03: 1 of "));
  const auto meta = nlohmann::json::parse(ReadFile(folder / "out/train_meta.json"));
  EXPECT_EQ(meta["fn"][0].size(), 5u);
  EXPECT_EQ(meta["fn"][1].size(), 4u);  // an image that is not there is not named
}

TEST(Export, NoImageAtAllIsRefused) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportOptions options;
  options.cameras = {"00_01"}, options.frames = {246};
  fs::remove(dataset.ImagePath("00_01", 246));
  EXPECT_THAT(MessageOf<FormatError>([&] { ExportDataset(dataset, "zju", folder / "out", options); }),
              HasSubstr("none of the 1"));
  EXPECT_FALSE(fs::exists(folder / "out"));
  options.images = ExportImages::kNone;
  EXPECT_EQ(ExportDataset(dataset, "zju", folder / "out", options).missing.asked(), 0);
}

TEST(Export, AnEarlierFileStaysWhereThereIsNoImage) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportOptions options;
  options.cameras = {"00_01"}, options.frames = {246};
  const std::string out = folder / "take.mcap";
  ExportDataset(dataset, "mcap", out, options);
  const std::string before = ReadFile(out);
  fs::remove(dataset.ImagePath("00_01", 246));
  EXPECT_THAT(MessageOf<FormatError>([&] { ExportDataset(dataset, "mcap", out, options); }), HasSubstr("none of the 1"));
  EXPECT_EQ(ReadFile(out), before);
}

TEST(WriteRig, SaysWhichLensDoesNotFitAndRenames) {
  const TempDir folder;
  Setting setting;
  setting.distorted = true;
  geometry::Rig rig = MakeRig(setting);
  EXPECT_THAT(MessageOf<FormatError>([&] { WriteRig(rig, "actorshq", folder / "a"); }), HasSubstr("00_00"));
  EXPECT_THAT(MessageOf<UsageError>([&] { WriteRig(rig, "trc", folder / "t"); }), HasSubstr("dataset export"));
  rig.cameras[1].camera.name = "left eye";
  const ExportReport report = WriteRig(rig, "zju", folder / "z");
  EXPECT_EQ(report.cameras[1].name, "left_eye");
  EXPECT_THAT(report.notes.at(0).text, HasSubstr("'left eye' is left_eye"));
  EXPECT_TRUE(fs::exists(folder / "z/annots.npy"));
}

TEST(Export, SameInputSameBytes) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  for (const char* format : {"dynamic3dgs", "zju", "gltf", "dna", "npz"}) {
    const ExportReport report = ExportDataset(dataset, format, folder / (std::string(format) + "1"), {});
    ExportDataset(dataset, format, folder / (std::string(format) + "2"), {});
    for (const std::string& file : report.files) {
      EXPECT_TRUE(ReadFile(folder / (std::string(format) + "1/" + file)) ==
                  ReadFile(folder / (std::string(format) + "2/" + file)))
          << format << " " << file;
    }
  }
}

}  // namespace
}  // namespace mvstudio::exports::testing
