#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// Names of cameras in files that list images, and folders that hold a calibration.
namespace mvstudio::calib {
namespace {

namespace fs = std::filesystem;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct ModelImage {
  std::string path;
  double x_m;
};

ImportedRig ReadColmapOf(const std::vector<ModelImage>& listed) {
  const TempDir folder;
  std::string images;
  int id = 0;
  for (const ModelImage& one : listed) {
    images += std::to_string(++id) + " 1 0 0 0 " + std::to_string(-one.x_m) + " 0 0 1 " + one.path + "\n\n";
  }
  WriteFileAtomic(folder / "cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n");
  WriteFileAtomic(folder / "images.txt", images);
  WriteFileAtomic(folder / "points3D.txt", "");
  return ReadColmap(folder.path());
}

std::vector<std::string> NamesOf(const ImportedRig& imported) { return geometry::CameraNames(imported.rig); }

std::string CodesOf(const ImportedRig& imported) {
  std::string codes;
  for (const Notice& note : imported.notes) codes += note.code + " ";
  return codes;
}

TEST(ImageNames, ImagesOfOneStandingCameraAreOneCamera) {
  const auto by_folder =
      ReadColmapOf({{"cam1/000000.jpg", 0}, {"cam1/000001.jpg", 0}, {"cam2/000000.jpg", 1}, {"cam2/000001.jpg", 1}});
  EXPECT_THAT(NamesOf(by_folder), ElementsAre("cam1", "cam2"));
  EXPECT_THAT(CodesOf(by_folder), HasSubstr("CAL-MERGED"));
  EXPECT_NEAR(by_folder.rig.cameras[1].CenterInWorld().x(), 1, 1e-12);
  const auto by_name = ReadColmapOf({{"f0/a.png", 0}, {"f0/b.png", 1}, {"f1/a.png", 0}, {"f1/b.png", 1}});
  EXPECT_THAT(NamesOf(by_name), ElementsAre("a", "b"));
  const auto flat = ReadColmapOf({{"cam1_0007.png", 0}, {"cam1_0008.png", 0}, {"cam2_0007.png", 1}});
  EXPECT_THAT(NamesOf(flat), ElementsAre("cam1", "cam2"));
}

TEST(ImageNames, CamerasAreTheirFoldersWhereFileNamesRepeat) {
  const auto read = ReadColmapOf({{"images/cam0/000000.jpg", 0}, {"images/cam1/000000.jpg", 1}});
  EXPECT_THAT(NamesOf(read), ElementsAre("cam0", "cam1"));
  const auto other = ReadColmapOf({{"a/left/rgb/1.jpg", 0}, {"b/left/rgb/1.jpg", 1}});
  EXPECT_THAT(NamesOf(other), ElementsAre("a", "b"));
}

TEST(ImageNames, MovingCamerasAreSaid) {
  const auto read = ReadColmapOf({{"cam1/0.jpg", 0}, {"cam1/1.jpg", 1}, {"cam2/0.jpg", 2}, {"cam2/1.jpg", 3}});
  EXPECT_EQ(read.rig.cameras.size(), 4u);
  EXPECT_THAT(CodesOf(read), HasSubstr("CAL-MOVING"));
  const auto plain = ReadColmapOf({{"images/0.jpg", 0}, {"images/1.jpg", 1}, {"images/2.jpg", 2}});
  EXPECT_THAT(NamesOf(plain), ElementsAre("images/0", "images/1", "images/2"));
  EXPECT_EQ(CodesOf(plain), "CAL-UNIT ");
}

TEST(CalibrationIn, FindsWhatAFolderHolds) {
  const TempDir folder;
  const auto put = [&](const std::string& path) { WriteFileAtomic(folder / path, "x"); };
  put("run/calibration.json"), put("run/transforms.json");
  put("project/sparse/0/cameras.bin"), put("project/sparse/0/images.bin");
  put("flat/sparse/cameras.txt"), put("flat/sparse/images.txt");
  put("panoptic/calibration_a.json");
  put("nerf/transforms.json");
  put("none/a.txt");
  EXPECT_EQ(CalibrationIn(folder / "run"), folder / "run/calibration.json");
  EXPECT_EQ(CalibrationIn(folder / "project"), folder / "project/sparse/0");
  EXPECT_EQ(CalibrationIn(folder / "flat"), folder / "flat/sparse");
  WriteFileAtomic(folder / "panoptic/hd_cam.txt", "notes of the day");  // its name alone makes it no camera
  EXPECT_EQ(CalibrationIn(folder / "panoptic"), folder / "panoptic/calibration_a.json");
  EXPECT_EQ(CalibrationIn(folder / "nerf"), folder / "nerf");
  EXPECT_EQ(CalibrationIn(folder / "nerf/transforms.json"), folder / "nerf/transforms.json");
  EXPECT_THAT(MessageOf<FormatError>([&] { DetectFormat(CalibrationIn(folder / "none")); }), HasSubstr("sparse/0"));
}

TEST(DetectFormat, UnknownFilesAreCalledThatWithTheirLayout) {
  const TempDir folder;
  const auto said = [&](const std::string& text) {
    WriteFileAtomic(folder / "file.json", text);
    return MessageOf<FormatError>([&] { DetectFormat(folder / "file.json"); });
  };
  EXPECT_THAT(said("{\"cam0.png\": {\"focal_length\": [1, 1], \"image_center\": [0, 0]}}"), HasSubstr("MVHumanNet"));
  EXPECT_THAT(said("{\"2201\": {\"distCoeff\": [], \"imgSize\": []}}"), HasSubstr("AvatarReX"));
  EXPECT_THAT(said("{\"w2c\": [], \"k\": [], \"cam_id\": []}"), HasSubstr("Dynamic 3D Gaussians"));
  EXPECT_THAT(said("{\"asset\": {}, \"nodes\": [], \"cameras\": []}"), HasSubstr("glTF"));
  EXPECT_THAT(said("0.5 0.6 0.5 0.5 0.9\n1280 1024\ncrop\n640 480\n"), HasSubstr("DSO"));
  EXPECT_THAT(said("engine: pytorch\ncrop: false\n"), Not(HasSubstr("DSO")));
  EXPECT_THAT(said(std::string("PK\x03\x04zip")), HasSubstr(".npz"));
  EXPECT_THAT(said("{\"hello\": 1}"),
              ::testing::AllOf(HasSubstr("not a calibration that is known here"), HasSubstr("panoptic")));
  EXPECT_THAT(said("[1, 2]"), HasSubstr("not a calibration that is known here"));
}

/// Two cameras of a rig that moves, at two moments each: text and binary.
TEST(ReadColmap, CamerasOfARigAreNotTheirImages) {
  const TempDir folder;
  fs::create_directories(folder / "text");
  WriteFileAtomic(folder / "text/cameras.txt", "1 PINHOLE 1024 1024 290 290 512 512\n2 PINHOLE 1920 1080 1500 1500 960 540\n");
  WriteFileAtomic(folder / "text/images.txt",
                  "1 1 0 0 0 0 0 0 1 rig/cam1/0001.jpg\n\n2 1 0 0 0 -0.2 0 0 2 rig/cam2/0001.jpg\n\n"
                  "3 1 0 0 0 0 0 -1 1 rig/cam1/0002.jpg\n\n4 1 0 0 0 -0.2 0 -1 2 rig/cam2/0002.jpg\n\n");
  WriteFileAtomic(folder / "text/rigs.txt", "# Rig\n1 3 CAMERA 1 IMU 7 0 CAMERA 2 1 1 0 0 0 -0.2 0 0\n");
  const ImportedRig read = ReadColmap(folder / "text");
  ASSERT_EQ(read.rig.cameras.size(), 2u);
  EXPECT_EQ(read.rig.cameras[0].camera.name, "cam1");
  EXPECT_EQ(read.rig.cameras[1].camera.name, "cam2");
  EXPECT_NEAR((read.rig.cameras[1].CenterInWorld() - Eigen::Vector3d(0.2, 0, 0)).norm(), 0, 1e-12);
  EXPECT_THAT(CodesOf(read), HasSubstr("CAL-MERGED"));

  // A rig of each camera by itself, as COLMAP 3.12 writes where nobody made rigs: images are cameras.
  WriteFileAtomic(folder / "text/rigs.txt", "1 1 CAMERA 1\n2 1 CAMERA 2\n");
  EXPECT_EQ(ReadColmap(folder / "text").rig.cameras.size(), 4u);
  WriteFileAtomic(folder / "text/rigs.txt", "1 2 CAMERA 1 CAMERA 2 1 1 0 0\n");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadColmap(folder / "text"); }), HasSubstr("rigs.txt: line 1"));
}

TEST(ReadColmap, ACountThatDoesNotHoldIsNamed) {
  const TempDir folder;
  WriteFileAtomic(folder / "cameras.txt", "# Number of cameras: 1\n1 PINHOLE 640 480 500 500 320 240\n");
  const std::string images = "# Number of images: 2, mean observations per image: 0\n1 1 0 0 0 0 0 0 1 a.jpg\n\n";
  WriteFileAtomic(folder / "images.txt", images);
  const ImportedRig cut = ReadColmap(folder.path());
  EXPECT_THAT(CodesOf(cut), HasSubstr("CAL-COUNT"));
  EXPECT_THAT(cut.notes[0].text, HasSubstr("states 2 images and holds 1"));
  WriteFileAtomic(folder / "images.txt", images + "2 1 0 0 0 1 0 0 1 b.jpg\n\n");
  EXPECT_EQ(CodesOf(ReadColmap(folder.path())).find("CAL-COUNT"), std::string::npos);
}

TEST(ReadColmap, RigsInBinary) {
  const TempDir folder;
  geometry::Rig rig;
  for (int c = 0; c < 2; ++c) {
    geometry::RigCamera camera;
    camera.camera.name = "cam" + std::to_string(c);
    camera.camera.width_px = camera.camera.height_px = 100;
    camera.camera.params = Eigen::Vector4d(90, 90, 50, 50);
    camera.cam_from_world.translation = {-0.2 * c, 0, 0};
    rig.cameras.push_back(camera);
  }
  WriteColmapModel(rig, {"cam0/1.png", "cam1/1.png"}, {}, folder.path());
  fs::remove(folder / "frames.bin");
  std::string bytes;
  const auto add = [&bytes](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  add(uint64_t{1}), add(uint32_t{1}), add(uint32_t{2}), add(int32_t{0}), add(uint32_t{1});
  add(int32_t{0}), add(uint32_t{2}), add(uint8_t{1});
  for (const double value : {1.0, 0.0, 0.0, 0.0, -0.2, 0.0, 0.0}) add(value);
  WriteFileAtomic(folder / "rigs.bin", bytes);
  const ImportedRig read = ReadColmap(folder.path());
  ASSERT_EQ(read.rig.cameras.size(), 2u);
  EXPECT_EQ(read.rig.cameras[1].camera.name, "cam1");
  EXPECT_EQ(CodesOf(read), "CAL-UNIT ") << "an image each: nothing was merged";
  WriteFileAtomic(folder / "rigs.bin", bytes.substr(0, bytes.size() - 3));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadColmap(folder.path()); }), HasSubstr("truncated"));
}

/// Written for COLMAP 3.12: one rig that took all images at once, in text and bytes alike.
TEST(ReadColmap, RigsAndFramesAreWrittenAndHeldAgainstImages) {
  const TempDir folder;
  geometry::Rig rig;
  for (int c = 0; c < 3; ++c) {
    geometry::RigCamera camera;
    camera.camera.name = "cam" + std::to_string(c);
    camera.camera.width_px = camera.camera.height_px = 100;
    camera.camera.params = Eigen::Vector4d(90, 90, 50, 50);
    camera.cam_from_world.rotation = Eigen::AngleAxisd(0.2 * c, Eigen::Vector3d::UnitY());
    camera.cam_from_world.translation = {-0.2 * c, 0, 1};
    rig.cameras.push_back(camera);
  }
  WriteColmapModel(rig, {"cam0.png", "cam1.png", "cam2.png"}, {}, folder / "images");
  EXPECT_THAT(ReadFile(folder / "images/rigs.txt"), HasSubstr("\n1 1 CAMERA 1\n2 1 CAMERA 2\n3 1 CAMERA 3\n"));
  EXPECT_THAT(ReadFile(folder / "images/frames.txt"), HasSubstr(" 1 CAMERA 3 3\n"));
  EXPECT_EQ(CodesOf(ReadColmap(folder / "images")), "CAL-UNIT ");
  for (const auto format : {CalibrationFormat::kColmap, CalibrationFormat::kColmapText})
    WriteCalibration(rig, format, folder.path());
  EXPECT_THAT(ReadFile(folder / "rigs.txt"), HasSubstr("\n1 3 CAMERA 1 CAMERA 2 1 "));
  EXPECT_THAT(ReadFile(folder / "frames.txt"), HasSubstr("3 CAMERA 1 1 CAMERA 2 2 CAMERA 3 3\n"));
  const auto read = [&](const char* file) {
    const ImportedRig found = ReadColmap(folder / file);
    EXPECT_EQ(found.rig.cameras.size(), 3u) << file;
    EXPECT_LT((found.rig.cameras[2].CenterInWorld() - rig.cameras[2].CenterInWorld()).norm(), 1e-12) << file;
    return CodesOf(found);
  };
  for (const char* file : {"cameras.bin", "cameras.txt"}) EXPECT_EQ(read(file), "CAL-UNIT ") << file;

  const std::string frames = ReadFile(folder / "frames.txt"), bytes = ReadFile(folder / "frames.bin");
  WriteFileAtomic(folder / "frames.txt", frames.substr(0, frames.rfind("CAMERA")) + "CAMERA 3 9\n");
  EXPECT_THAT(read("cameras.txt"), HasSubstr("CAL-COUNT"));  // an image that is not there
  WriteFileAtomic(folder / "frames.txt", frames + frames.substr(frames.rfind("\n1 1 ") + 1));
  EXPECT_THAT(read("cameras.txt"), HasSubstr("CAL-COUNT"));  // more frames than stated
  const auto refused = [&](const char* file) { return MessageOf<FormatError>([&] { ReadColmap(folder / file); }); };
  WriteFileAtomic(folder / "frames.txt", frames.substr(0, frames.size() - 4));
  EXPECT_THAT(refused("cameras.txt"), HasSubstr("ends too early"));
  WriteFileAtomic(folder / "frames.txt", "1 7 1 0 0 0 0 0 1 0\n");
  EXPECT_THAT(refused("cameras.txt"), HasSubstr("no rig 7"));
  WriteFileAtomic(folder / "frames.txt", "1 1 1 0 0 0 0 0 1.1 3 CAMERA 1 1 CAMERA 2 2 CAMERA 3 3\n");
  EXPECT_THAT(refused("cameras.txt"), HasSubstr("image cam0.png stands elsewhere"));
  std::string moved = bytes;
  const double there = 1.1;
  moved.replace(8 + 4 + 4 + 6 * 8, 8, reinterpret_cast<const char*>(&there), 8);
  WriteFileAtomic(folder / "frames.bin", moved);
  EXPECT_THAT(refused("cameras.bin"), HasSubstr("image cam0.png stands elsewhere"));
  WriteFileAtomic(folder / "frames.bin", bytes.substr(0, bytes.size() - 3));
  EXPECT_THAT(refused("cameras.bin"), HasSubstr("truncated"));

  // Lines of points left out: every other image would be taken for the points of the one before.
  fs::remove(folder / "frames.txt");
  WriteFileAtomic(folder / "images.txt", "1 1 0 0 0 0 0 1 1 cam0.png\n2 1 0 0 0 0 0 1 2 cam1.png\n");
  EXPECT_THAT(refused("cameras.txt"), HasSubstr("an image has two lines"));
}

TEST(ReadKalibr, ClocksThatAreApartAreSaid) {
  const TempDir folder;
  const auto text = [&](const std::string& shift) {
    const std::string lens = "  camera_model: pinhole\n  intrinsics: [400, 400, 320, 240]\n  resolution: [640, 480]\n";
    WriteFileAtomic(folder / "a.yaml",
                    "cam0:\n" + lens + "  timeshift_cam_imu: 0.002\ncam1:\n" + lens + "  timeshift_cam_imu: " + shift + "\n");
    std::string all;
    for (const Notice& note : ReadCalibration(CalibrationFormat::kKalibr, {folder / "a.yaml"}).notes) all += note.text;
    return all;
  };
  EXPECT_THAT(text("0.002"), ::testing::Not(HasSubstr("timeshift")));
  EXPECT_THAT(text("0.012"), HasSubstr("differs by up to 10 ms"));
}

/// One event, at 5 s of the IMU's clock. Camera c stamps it 5 - shift_c; its frames have stamps f / 50, so that it is in frame
/// (5 - shift_c) * 50: for cam0 249.9, for cam1 249.4. A time offset is the camera's frame less the rig's.
TEST(ReadKalibr, TimeShiftsBecomeOffsetsOfFrames) {
  const TempDir folder;
  const std::string lens = "  camera_model: pinhole\n  intrinsics: [400, 400, 320, 240]\n  resolution: [640, 480]\n";
  const std::string cam0 = "cam0:\n" + lens + "  timeshift_cam_imu: 0.002\n", cam1 = "cam1:\n" + lens;
  WriteFileAtomic(folder / "all.yaml", cam0 + cam1 + "  timeshift_cam_imu: 0.012\n");
  WriteFileAtomic(folder / "one.yaml", cam0 + cam1);
  ReadOptions options;
  options.frame_rate_hz = 50;
  const geometry::Rig rig = ReadCalibration(CalibrationFormat::kKalibr, {folder / "all.yaml"}, options).rig;
  const double event_s = 5, in_cam0 = (event_s - 0.002) * 50, in_cam1 = (event_s - 0.012) * 50;
  ASSERT_TRUE(rig.cameras[0].time_offset && rig.cameras[1].time_offset);
  EXPECT_EQ(rig.cameras[0].time_offset->frames, 0);
  EXPECT_NEAR(rig.cameras[1].time_offset->frames, in_cam1 - in_cam0, 1e-12);
  EXPECT_FALSE(ReadCalibration(CalibrationFormat::kKalibr, {folder / "one.yaml"}, options).rig.cameras[1].time_offset);
  options.frame_rate_hz = 0;
  const ImportedRig unknown = ReadCalibration(CalibrationFormat::kKalibr, {folder / "all.yaml"}, options);
  EXPECT_FALSE(unknown.rig.cameras[1].time_offset);
  ASSERT_FALSE(unknown.notes.empty());
  EXPECT_THAT(unknown.notes[0].hint, HasSubstr("option 'frame-rate'"));
}

/// Chains that are not whole, several of them, and lenses whose words do not agree.
TEST(ReadKalibr, PosesAndLensesThatTheFileDoesNotHold) {
  const TempDir folder;
  const auto camera = [](const std::string& number, const std::string& more, const std::string& lens = "pinhole",
                         const std::string& distortion = "radtan", const std::string& coefficients = "[0, 0, 0, 0]") {
    const std::string first = lens == "omni" ? "1.2, " : lens == "ds" ? "-0.2, 0.6, " : "";
    return "cam" + number + ":\n  camera_model: " + lens + "\n  intrinsics: [" + first + "400, 400, 320, 240]\n" +
           (distortion.empty() ? "" : "  distortion_model: " + distortion + "\n") + "  distortion_coeffs: " + coefficients +
           "\n  resolution: [640, 480]\n" + more;
  };
  const auto pose = [](const char* key, const char* x) {
    return std::string("  ") + key + ": [[1, 0, 0, " + x + "], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
  };
  const std::string before = pose("T_cn_cnm1", "-0.1"), imu0 = pose("T_cam_imu", "0.5"), imu1 = pose("T_cam_imu", "0.2");
  const std::string a = folder / "a.yaml", b = folder / "b.yaml";
  const auto read = [&](const std::string& text, const std::string& other = "") {
    WriteFileAtomic(a, text), WriteFileAtomic(b, other);
    return ReadCalibration(CalibrationFormat::kKalibr, other.empty() ? std::vector{a} : std::vector{a, b});
  };
  const auto refused = [&](const std::string& text, const std::string& other = "") {
    return MessageOf<FormatError>([&] { read(text, other); });
  };
  EXPECT_THAT(refused(camera("0", "") + camera("1", "") + camera("2", before)), HasSubstr("nothing places this camera"));
  EXPECT_THAT(refused(camera("0", "") + camera("2", before)), HasSubstr("there is cam2 and no cam1"));
  EXPECT_THAT(CodesOf(read(camera("0", before) + camera("1", before))), HasSubstr("CAL-KEYS"));
  // A pose is missing, both cameras know the IMU's.
  const auto by_imu = read(camera("0", imu0) + camera("1", imu1) + camera("2", before)).rig;
  EXPECT_LT((by_imu.cameras[2].CenterInWorld() - Eigen::Vector3d(0.4, 0, 0)).norm(), 1e-12);
  // OpenVINS gives the IMU's poses the other way round, and heads the file as OpenCV does.
  const auto open_vins =
      read("%YAML:1.0\n" + camera("0", pose("T_imu_cam", "-0.5")) + camera("1", pose("T_imu_cam", "-0.2"))).rig;
  EXPECT_EQ(DetectFormat(a), CalibrationFormat::kKalibr);
  EXPECT_LT((open_vins.cameras[0].CenterInWorld() - Eigen::Vector3d(-0.5, 0, 0)).norm(), 1e-12);
  EXPECT_LT((open_vins.cameras[1].CenterInWorld() - Eigen::Vector3d(-0.2, 0, 0)).norm(), 1e-12);
  // A pose that stands there twice, two ways.
  const std::string other = pose("T_imu_cam", "-0.5"), same = pose("T_imu_cam", "0.5"), back = pose("T_cn_cnm1", "0.3");
  EXPECT_EQ(read(camera("0", imu0 + other) + camera("1", imu1)).rig.cameras.size(), 2u);
  EXPECT_THAT(refused(camera("0", imu0 + same) + camera("1", imu1)), HasSubstr("T_imu_cam are two different poses"));
  EXPECT_THAT(refused(camera("0", imu0) + camera("1", imu1 + back)), HasSubstr("T_cn_cnm1 and that by T_cam_imu"));
  EXPECT_EQ(read(camera("0", imu0) + camera("1", imu1 + pose("T_cn_cnm1", "-0.302"))).rig.cameras.size(), 2u);
  // Several chains: placed by one IMU, or lenses alone, or not one rig.
  const auto of_imu = read(camera("0", imu0) + camera("1", imu1), camera("0", imu0)).rig;
  EXPECT_EQ(GaugeText(of_imu.gauge), "Kalibr's IMU");
  EXPECT_EQ(of_imu.cameras[1].camera.name, "a_cam1");
  EXPECT_EQ(of_imu.cameras[2].camera.name, "b");
  EXPECT_LT((of_imu.cameras[1].CenterInWorld() - Eigen::Vector3d(-0.2, 0, 0)).norm(), 1e-12);
  EXPECT_THAT(CodesOf(read(camera("0", ""), camera("0", ""))), HasSubstr("CAL-NOPOSE"));
  EXPECT_THAT(refused(camera("0", "") + camera("1", before), camera("0", "")), HasSubstr("nothing places its cameras"));

  for (const char* lens : {"omni", "ds"}) {
    EXPECT_THAT(refused(camera("0", "", lens, "radtan", "[0.1, 0, 0, 0]")), HasSubstr("k1 and k2")) << lens;
    EXPECT_THAT(refused(camera("0", "", lens, "equidistant")), HasSubstr("'equidistant'")) << lens;
    EXPECT_THAT(refused(camera("0", "", lens, "none", "[0.1, 0, 0, 0]")), HasSubstr("says none")) << lens;
  }
  EXPECT_THAT(refused(camera("0", "", "pinhole", "fov")), HasSubstr("'fov'"));
  EXPECT_THAT(refused(camera("0", "", "pinhole", "", "[0.1, 0, 0, 0]")), HasSubstr("without distortion_model"));
  EXPECT_EQ(read(camera("0", "", "omni")).rig.cameras[0].camera.model, geometry::LensModel::kUcm);
}

TEST(ReadEuroc, BodyFromCameraAndItsLens) {
  const TempDir folder;
  for (const std::string name : {"cam0", "cam1"}) {
    fs::create_directories(folder / name);
    WriteFileAtomic(folder / name + "/sensor.yaml",
                    std::string(name == "cam1" ? "%YAML:1.0\n" : "") +  // as Kimera heads it
                        "sensor_type: camera\ncomment: VI\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, "
                        "0, 0, 1, 0.3, 0, 0, 0, 1]\nrate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\n"
                        "intrinsics: [458, 457, 367, 248]\ndistortion_model: radial-tangential\n"
                        "distortion_coefficients: [-0.28, 0.07, 0.0002, 0.00001]\n");
  }
  const std::string first = folder / "cam0/sensor.yaml";
  EXPECT_EQ(DetectFormat(first), CalibrationFormat::kKalibr);
  const ImportedRig read = ReadCalibration(CalibrationFormat::kKalibr, {first, folder / "cam1/sensor.yaml"});
  ASSERT_EQ(read.rig.cameras.size(), 2u);
  EXPECT_EQ(read.rig.cameras[1].camera.name, "cam1");
  EXPECT_EQ(read.rig.cameras[0].camera.model, geometry::LensModel::kBrown4);
  EXPECT_NEAR((read.rig.cameras[0].CenterInWorld() - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), 0, 1e-12);
  // x of the camera lies along y of the body.
  EXPECT_NEAR(
      (Inverse(read.rig.cameras[0].cam_from_world).rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 0,
      1e-12);
  WriteFileAtomic(first, "sensor_type: imu\nT_BS: 1\nintrinsics: 0\n");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadCalibration(CalibrationFormat::kKalibr, {first}); }), HasSubstr("imu"));
}

TEST(ReadCalibration, SplatCamerasAndCamerasByName) {
  const TempDir folder;
  const std::string splats = folder / "cameras.json", named = folder / "calibration_full.json";
  WriteFileAtomic(splats,
                  "[{\"id\": 0, \"img_name\": \"a\", \"width\": 640, \"height\": 480, \"position\": [1, 2, 3], "
                  "\"rotation\": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], \"fy\": 501, \"fx\": 500}]");
  const ImportedRig read = ReadCalibration(DetectFormat(splats), {splats});
  EXPECT_EQ(read.rig.cameras[0].camera.name, "a");
  EXPECT_NEAR((read.rig.cameras[0].CenterInWorld() - Eigen::Vector3d(1, 2, 3)).norm(), 0, 1e-12);
  EXPECT_NEAR(read.rig.cameras[0].camera.cx(), 319.5, 1e-12);
  EXPECT_THAT(CodesOf(read), HasSubstr("CAL-CENTRED"));

  WriteFileAtomic(named,
                  "{\"22\": {\"K\": [1000, 0, 959.5, 0, 1001, 539.5, 0, 0, 1], \"R\": [0, 1, 0, -1, 0, 0, 0, 0, 1], "
                  "\"T\": [0, 0, 2], \"distCoeff\": [0, 0, 0, 0, 0], \"imgSize\": [1920, 1080], \"rectifyAlpha\": 0.0}}");
  const ImportedRig by_name = ReadCalibration(DetectFormat(named), {named});
  EXPECT_EQ(by_name.rig.cameras[0].camera.name, "22");
  EXPECT_EQ(by_name.rig.cameras[0].camera.fy(), 1001);
  EXPECT_NEAR((by_name.rig.cameras[0].cam_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, -1, 2)).norm(), 0, 1e-12);
}

}  // namespace
}  // namespace mvstudio::calib
