#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// Where cameras stand, by the many names that programs give it: read, or refused; never dropped.
namespace mvstudio::calib {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// Camera k of a rig: turned by a quarter about z for odd k, t = (k, 2, 5).
struct Stand {
  explicit Stand(int k) : turned(k % 2 == 1), number(k) {}
  std::string R() const { return turned ? "0,-1,0, 1,0,0, 0,0,1" : "1,0,0, 0,1,0, 0,0,1"; }
  std::string RTransposed() const { return turned ? "0,1,0, -1,0,0, 0,0,1" : R(); }
  std::string Rows() const { return turned ? "[0,-1,0],[1,0,0],[0,0,1]" : "[1,0,0],[0,1,0],[0,0,1]"; }
  std::string Rt() const {
    const std::string x = std::to_string(number);
    return turned ? "[0,-1,0," + x + "],[1,0,0,2],[0,0,1,5]" : "[1,0,0," + x + "],[0,1,0,2],[0,0,1,5]";
  }
  /// world from camera: R^T and -R^T t
  std::string InverseRt() const {
    const std::string x = std::to_string(number);
    return turned ? "[0,1,0,-2],[-1,0,0," + x + "],[0,0,1,-5]" : "[1,0,0,-" + x + "],[0,1,0,-2],[0,0,1,-5]";
  }
  std::string T() const { return std::to_string(number) + ",2,5"; }

  bool turned;
  int number;
};

std::string Matrix(const std::string& key, int rows, int cols, const std::string& numbers) {
  return key + ": !!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(cols) +
         "\n   dt: d\n   data: [ " + numbers + " ]\n";
}

class PosesOfFiles : public ::testing::Test {
 protected:
  ImportedRig Read(const std::string& text, const std::string& name = "a.json") {
    WriteFileAtomic(folder_ / name, text);
    return ReadFiles({folder_ / name});
  }
  static ImportedRig ReadFiles(const std::vector<std::string>& paths) {
    ReadOptions options;
    options.width_px = 1280, options.height_px = 720;
    return ReadCalibration(DetectFormat(paths[0]), paths, options);
  }
  /// Cameras by name, `pose` of each beside its lens.
  static std::string Json(int count, const std::function<std::string(const Stand&)>& pose) {
    std::string text = "{";
    for (int k = 0; k < count; ++k)
      text += (k ? ", \"cam" : "\"cam") + std::to_string(k) + R"(": {"K": [[80)" + std::to_string(k) +
              R"(,0,640],[0,800,360],[0,0,1]], "dist": [-0.1,0.02,0.001,0.002,0], )" + pose(Stand(k)) + "}";
    return text + "}";
  }
  static void ExpectStands(const ImportedRig& imported, size_t count) {
    const auto& cameras = imported.rig.cameras;
    ASSERT_EQ(cameras.size(), count);
    for (size_t k = 0; k < count; ++k) {
      EXPECT_EQ(cameras[k].camera.name, "cam" + std::to_string(k));
      EXPECT_EQ(cameras[k].camera.fx(), 800 + static_cast<double>(k));
      const Eigen::Vector3d x = cameras[k].cam_from_world * Eigen::Vector3d(1, 0, 0);
      const Eigen::Vector3d t(static_cast<double>(k), 2, 5);
      EXPECT_LT((x - t - (k % 2 ? Eigen::Vector3d(0, 1, 0) : Eigen::Vector3d(1, 0, 0))).norm(), 1e-12) << "camera " << k;
    }
  }
  TempDir folder_;
};

TEST_F(PosesOfFiles, OneMatrixInEitherDirection) {
  for (const std::string key : {"w2c", "T_cam_world", "world_to_camera", "extrinsics", "cam_from_world"})
    ExpectStands(Read(Json(3, [&](const Stand& s) { return "\"" + key + "\": [" + s.Rt() + ",[0,0,0,1]]"; })), 3);
  for (const std::string key : {"c2w", "T_world_cam", "cam2world", "world_from_cam"})
    ExpectStands(Read(Json(3, [&](const Stand& s) { return "\"" + key + "\": [" + s.InverseRt() + "]"; })), 3);
}

/// Intrinsics and extrinsics as matrices of their own.
TEST_F(PosesOfFiles, IntrinsicsAndExtrinsicsAsLists) {
  std::string text = Json(3, [](const Stand& s) { return "\"extrinsics\": [" + s.Rt() + "]"; });
  for (size_t at = text.find("\"K\""); at != std::string::npos; at = text.find("\"K\"", at))
    text.replace(at, 3, "\"intrinsics\"");
  ExpectStands(Read(text), 3);
  EXPECT_EQ(Read(R"({"intrinsics": {"camera_matrix": [[800,0,640],[0,800,360],[0,0,1]], "dist_coeffs": [0.1,0,0,0,0]},
                     "extrinsics": [{"rvec": [0,0,1], "tvec": [1,2,3]}]})")
                .rig.cameras.size(),
            1u)
      << "a table of the lens, beside views of a board";
}

TEST_F(PosesOfFiles, ByNamesThatAreNotKnownAreRefused) {
  const auto why = [&](const std::string& pose) {
    return MessageOf<FormatError>([&] { Read(Json(2, [&](const Stand&) { return pose; })); });
  };
  EXPECT_THAT(why(R"("q": [0,0,0,1], "t": [1,2,3])"), AllOf(HasSubstr("cam0.q"), HasSubstr("T = -R c")));
  EXPECT_THAT(why(R"("position": [1,2,3], "R": [[1,0,0],[0,1,0],[0,0,1]])"), HasSubstr("seems to say where"));
  EXPECT_THAT(why(R"("rotation": [0.1,0.2,0.3], "translation": [1,2,3])"), HasSubstr("cam0.rotation"))
      << "three angles, of whatever order";
  EXPECT_THAT(why(R"("camera_pose": [[1,0,0,0],[0,1,0,0],[0,0,1,0]])"), HasSubstr("cam0.camera_pose"));
  EXPECT_EQ(Read(Json(2, [](const Stand&) { return R"("rms": 0.3, "t_error": [])"; })).rig.cameras.size(), 2u)
      << "lenses alone, as before";
  const std::string views =
      R"("extrinsics": [{"rvec": [0,0,1], "tvec": [1,2,3]}], "rvecs": [[0,0,1],[0,1,0],[0,0,0],[1,0,0],[1,1,0]])";
  EXPECT_EQ(Read(Json(2, [&](const Stand&) { return views; })).rig.cameras.size(), 2u) << "where boards stood";
}

/// What changes the meaning of a file is refused in the table of a camera, too.
TEST_F(PosesOfFiles, KeysOfACameraThatChangeItsMeaning) {
  const auto why = [&](const std::string& key) {
    return MessageOf<FormatError>([&] { Read(Json(2, [&](const Stand& s) { return key + ", \"w2c\": [" + s.Rt() + "]"; })); });
  };
  EXPECT_THAT(why(R"("unit": "mm")"), AllOf(HasSubstr("cam0.unit"), HasSubstr("option 'unit' mm")));
  EXPECT_THAT(why(R"("skew": 1.5)"), HasSubstr("cam0.skew"));
  EXPECT_THAT(why(R"("xi": 0.9)"), HasSubstr("cam0.xi"));
  EXPECT_EQ(why(R"("unit": "m")"), "no exception");
}

/// Columns for rows: the turn would be the other way round, and the place lost.
TEST_F(PosesOfFiles, ATransposedMatrixIsRefused) {
  const auto why = [&](const std::string& pose) {
    return MessageOf<FormatError>([&] { Read(Json(3, [&](const Stand&) { return "\"w2c\": " + pose; })); });
  };
  EXPECT_THAT(why("[[0,1,0,0],[-1,0,0,0],[0,0,1,0],[1,2,5,1]]"), AllOf(HasSubstr("cam0.w2c"), HasSubstr("transposed")));
  EXPECT_THAT(why("[0,1,0,0, -1,0,0,0, 0,0,1,0, 1,2,5,1]"), HasSubstr("transposed")) << "a flat list";
  EXPECT_THAT(why("[[0,1,0,1],[-1,0,0,2],[0,0,1,5],[0,0,0,2]]"), HasSubstr("0, 0, 0, 1"));
  EXPECT_EQ(why("[[0,1,0,1],[-1,0,0,2],[0,0,1,5],[0,1e-17,0,1]]"), "no exception");
}

/// A camera matrix in px, beside the lens in mm.
TEST_F(PosesOfFiles, APairInMillimetresBesideACameraMatrix) {
  std::string text = Json(
      3, [](const Stand& s) { return "\"focal_length\": [8, 8], \"principal_point\": [3.6, 2.4], \"w2c\": [" + s.Rt() + "]"; });
  ExpectStands(Read(text), 3);
  for (size_t at = text.find("\"K\""); at != std::string::npos; at = text.find("\"K\"", at))
    text.replace(at, 3, "\"camera_matrix\"");
  ExpectStands(Read(text), 3);
}

/// ROS's R rectifies; lenses alone are read from several of its messages.
TEST_F(PosesOfFiles, SeveralMessagesOfRos) {
  std::vector<std::string> paths;
  for (const std::string name : {"cam0", "cam1"}) {
    paths.push_back(folder_ / (name + ".yaml"));
    WriteFileAtomic(
        paths.back(),
        "header:\n  frame_id: cam\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\nd: [0.1, -0.03, 0.004, -0.007, "
        "0.0]\nk: [400, 0, 320, 0, 400, 240, 0, 0, 1]\nr: [1, 0, 0, 0, 1, 0, 0, 0, 1]\np: [400, 0, 320, 0, 0, 400, "
        "240, 0, 0, 0, 1, 0]\nbinning_x: 0\n");
  }
  const ImportedRig imported = ReadFiles(paths);
  ASSERT_EQ(imported.rig.cameras.size(), 2u);
  EXPECT_EQ(imported.rig.cameras[1].camera.fx(), 400);
}

/// Keys too long for a message, and one key by two names.
TEST_F(PosesOfFiles, KeysOfNumberedCameras) {
  const std::string odd = std::string(200, 'x') + "\xc3\xa4_";
  std::string text = "%YAML:1.0\n---\n";
  for (int k = 0; k < 3; ++k) {
    const std::string n = std::to_string(k);
    const Stand s(k);
    text += Matrix("K" + n, 3, 3, "80" + n + ",0,640, 0,800,360, 0,0,1") + Matrix("R" + n, 3, 3, s.R()) +
            Matrix("T" + n, 3, 1, s.T()) + Matrix("D" + n, 1, 5, "-0.1,0.02,0.001,0.002,0") + odd + n + ": 1\n";
  }
  ExpectStands(Read(text, "a.yml"), 3);
  EXPECT_THAT(MessageOf<FormatError>([&] { Read(text + Matrix("cam1_K", 3, 3, "900,0,640, 0,900,360, 0,0,1"), "b.yml"); }),
              HasSubstr("occurs twice"));
}

TEST_F(PosesOfFiles, AniposeWordsAsJson) {
  const std::string lens = R"("size": [640, 480], "distortions": [-0.1, 0.02, 0, 0, 0], )";
  const ImportedRig imported = Read(
      "[{" + lens + R"("name": "c01", "matrix": [[500,0,320],[0,500,240],[0,0,1]], "rotation": [0,0,1.5707963267948966],
               "translation": [1,2,3]}, {)" +
      lens + R"("name": "c02", "matrix": [[510,0,320],[0,500,240],[0,0,1]], "rotation": [0,0,0], "translation": [0,0,4]}])");
  ASSERT_EQ(imported.rig.cameras.size(), 2u);
  EXPECT_EQ(imported.rig.cameras[1].camera.name, "c02");
  EXPECT_EQ(imported.rig.cameras[1].camera.width_px, 640);
  EXPECT_LT((imported.rig.cameras[0].cam_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-12);
}

/// Numbers behind or before the names: all cameras of a file, not its first two as a stereo pair.
TEST_F(PosesOfFiles, NumberedCamerasOfOneFile) {
  for (const bool before : {false, true}) {
    std::string text = "%YAML:1.0\n---\nnum_cameras: 4\n";
    for (int k = 0; k < 4; ++k) {
      const Stand s(k);
      const auto key = [&](const std::string& word) {
        return before ? "cam" + std::to_string(k) + "_" + word : word + std::to_string(k);
      };
      text += Matrix(key("K"), 3, 3, "80" + std::to_string(k) + ",0,640, 0,800,360, 0,0,1") +
              Matrix(key("D"), 1, 5, "-0.1,0.02,0.001,0.002,0") + Matrix(key("R"), 3, 3, s.R()) + Matrix(key("T"), 3, 1, s.T());
    }
    ExpectStands(Read(text, "a.yml"), 4);
  }
  const std::string stereo = "%YAML:1.0\n---\n" + Matrix("K1", 3, 3, "800,0,640, 0,800,360, 0,0,1") +
                             Matrix("K2", 3, 3, "801,0,640, 0,800,360, 0,0,1") + Matrix("R", 3, 3, Stand(0).R()) +
                             Matrix("T", 3, 1, "-1,0,0") + Matrix("R1", 3, 3, Stand(0).R()) + Matrix("R2", 3, 3, Stand(0).R());
  const ImportedRig pair = Read(stereo, "s.yml");
  ASSERT_EQ(pair.rig.cameras.size(), 2u);
  EXPECT_EQ(pair.rig.cameras[1].camera.name, "right") << "R1 and R2 rectify";
  EXPECT_EQ(pair.rig.cameras[1].CenterInWorld(), Eigen::Vector3d(1, 0, 0));
  std::string short_names = stereo;
  for (const char* key : {"K1:", "K2:"}) short_names.replace(short_names.find(key), 1, "CM");
  EXPECT_EQ(Read(short_names, "c.yml").rig.cameras.size(), 2u);
}

/// JARVIS multiplies rows from the right.
TEST_F(PosesOfFiles, TransposedMatricesOfJarvis) {
  std::vector<std::string> paths;
  for (int k = 0; k < 3; ++k) {
    const Stand s(k);
    paths.push_back(folder_ / ("cam" + std::to_string(k) + ".yaml"));
    WriteFileAtomic(paths.back(), "%YAML:1.0\n---\n" + Matrix("T", 3, 1, s.T()) + Matrix("R", 3, 3, s.RTransposed()) +
                                      Matrix("intrinsicMatrix", 3, 3, "80" + std::to_string(k) + ",0,0, 0,800,0, 640,360,1") +
                                      Matrix("distortionCoefficients", 1, 5, "-0.1,0.02,0.001,0.002,0"));
  }
  const ImportedRig imported = ReadFiles(paths);
  ExpectStands(imported, 3);
  EXPECT_EQ(
      std::count_if(imported.notes.begin(), imported.notes.end(), [](const auto& n) { return n.code == "CAL-TRANSPOSED"; }), 1);
}

TEST_F(PosesOfFiles, FramesWithMatricesOfTheirOwn) {
  const auto frame = [](const std::string& name, const std::string& lens, const std::string& x) {
    return R"({"file_path": "images/)" + name + R"(.png", )" + lens + R"( "transform_matrix": [[1,0,0,)" + x +
           "],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}";
  };
  const std::string head = R"({"fl_x": 700, "fl_y": 700, "cx": 640, "cy": 360, "w": 1280, "h": 720, "frames": [)";
  const ImportedRig imported =
      Read(head + frame("cam0", R"("K": [[800,0,641],[0,801,362],[0,0,1]],)", "0") + "," +
           frame("cam1", R"("intrinsics": [810,0,643,0,811,364,0,0,1],)", "1") + "," + frame("cam2", "", "2") + "]}");
  ASSERT_EQ(imported.rig.cameras.size(), 3u);
  EXPECT_EQ(imported.rig.cameras[0].camera.fx(), 800);
  EXPECT_EQ(imported.rig.cameras[0].camera.cy(), 361.5);
  EXPECT_EQ(imported.rig.cameras[1].camera.fy(), 811);
  EXPECT_EQ(imported.rig.cameras[2].camera.fx(), 700);
  EXPECT_THAT(MessageOf<FormatError>([&] { Read(head + frame("cam0", R"("K": [800,0,0,0,801,0,641,362,1],)", "0") + "]}"); }),
              AllOf(HasSubstr("frames[0].K"), HasSubstr("transposed")));
}

/// A lens whose last terms are zero is the shorter one, and needs no leave to be written as that.
TEST_F(PosesOfFiles, ZeroTermsAreLeftOut) {
  const ImportedRig imported = Read(Json(2, [](const Stand& s) { return "\"w2c\": [" + s.Rt() + "]"; }));
  const ExportReport report = WriteCalibration(imported.rig, CalibrationFormat::kNerfstudio, folder_ / "transforms.json", {});
  for (const auto& note : report.notes) EXPECT_NE(note.code, "CAL-APPROXIMATED");
  ExpectStands(ReadFiles({folder_ / "transforms.json"}), 2);
}

/// JSON of cameras is Panoptic's only with its sizes; coefficients may stand alone.
TEST_F(PosesOfFiles, ListsAndTablesOfCameras) {
  const auto camera = [](const Stand& s, const std::string& before) {
    const std::string k = std::to_string(s.number);
    return before + R"("image_size": [1280, 720], "K": [[80)" + k +
           R"(,0,640],[0,800,360],[0,0,1]], "dist": [], "k1": -0.125, "R": [)" + s.Rows() + R"(], "T": [)" + s.T() + "]}";
  };
  const auto named = [](int k) { return R"({"name": "cam)" + std::to_string(k) + "\", "; };
  const ImportedRig listed = Read("{\"cameras\": [" + camera(Stand(0), named(0)) + ", " + camera(Stand(1), named(1)) + "]}");
  ExpectStands(listed, 2);
  EXPECT_EQ(listed.rig.cameras[0].camera.params[4], -0.125);
  ExpectStands(Read(R"({"cameras": {"cam0": )" + camera(Stand(0), "{") + R"(, "cam1": )" + camera(Stand(1), "{") + "}}"), 2);
}

/// EasyMocap's intri.yml may list more cameras than extri.yml places.
TEST_F(PosesOfFiles, CamerasThatEasyMocapDoesNotPlace) {
  const auto lens = [](const std::string& name) { return Matrix("K_" + name, 3, 3, "800,0,640, 0,800,360, 0,0,1"); };
  WriteFileAtomic(folder_ / "intri.yml",
                  "%YAML:1.0\n---\nnames:\n  - \"cam0\"\n  - \"spare\"\n" + lens("cam0") + lens("spare"));
  WriteFileAtomic(folder_ / "extri.yml", "%YAML:1.0\n---\nnames:\n  - \"cam0\"\n" + Matrix("Rot_cam0", 3, 3, Stand(0).R()) +
                                             Matrix("T_cam0", 3, 1, Stand(0).T()));
  const ImportedRig imported = ReadFiles({folder_.path()});
  ExpectStands(imported, 1);
  EXPECT_TRUE(std::any_of(imported.notes.begin(), imported.notes.end(),
                          [](const auto& n) { return n.code == "CAL-IGNORED" && n.text.find("spare") != std::string::npos; }));
}

/// OKVIS: T_SC is sensor from camera, 16 numbers row by row; the world is the sensor.
TEST_F(PosesOfFiles, CamerasOfOkvis) {
  const auto camera = [](const std::string& focal, const std::string& pose) {
    return "    - {T_SC:\n        [" + pose +
           ", 0,0,0,1],\n        image_dimension: [1280, 720],\n        distortion_coefficients: " +
           "[-0.28, 0.07, 0.0002, 0.00002],\n        distortion_type: radialtangential,\n        focal_length: [" + focal +
           ", 800],\n        principal_point: [640, 360]}\n";
  };
  const ImportedRig imported = Read("%YAML:1.0\n---\ncameras:\n" + camera("800", "1,0,0,0, 0,1,0,-2, 0,0,1,-5") +
                                        camera("801", "0,1,0,-2, -1,0,0,1, 0,0,1,-5"),
                                    "okvis.yaml");
  ASSERT_EQ(imported.rig.cameras.size(), 2u);
  EXPECT_EQ(imported.rig.cameras[1].camera.fx(), 801);
  EXPECT_EQ(imported.rig.cameras[1].camera.params[4], -0.28);
  EXPECT_LT((imported.rig.cameras[1].cam_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 5)).norm(), 1e-12);
}

TEST_F(PosesOfFiles, OfHuman36mAndInterHand) {
  const auto human = [](const std::string& subjects) {
    return R"({"intrinsics": {"cam0": {"calibration_matrix": [[800,0,640],[0,801,360],[0,0,1]], "distortion": [-0.2,0.2,0,0,0]},
                              "cam1": {"calibration_matrix": [[801,0,640],[0,801,360],[0,0,1]], "distortion": [-0.2,0.2,0,0,0]}},
              "extrinsics": {)" +
           subjects + "}}";
  };
  const std::string subject = R"(: {"cam0": {"R": [)" + Stand(0).Rows() + R"(], "t": [[0],[2000],[5000]]}, "cam1": {"R": [)" +
                              Stand(1).Rows() + R"(], "t": [[1000],[2000],[5000]]}})";
  ExpectStands(Read(human("\"S1\"" + subject)), 2);
  EXPECT_THAT(MessageOf<FormatError>([&] { Read(human("\"S1\"" + subject + ", \"S5\"" + subject)); }),
              AllOf(HasSubstr("2 subjects (S1, S5)"), HasSubstr("keep the one")));
  // campos is the centre: of camera 1, -R^T t = (-2, 1, -5)
  ExpectStands(Read(R"({"0": {"campos": {"0": [0,-2000,-5000], "1": [-2000,1000,-5000]}, "camrot": {"0": [)" + Stand(0).Rows() +
                    R"(], "1": [)" + Stand(1).Rows() +
                    R"(]}, "focal": {"0": [800,800], "1": [801,800]}, "princpt": {"0": [640,360], "1": [640,360]}}})"),
               2);
}

}  // namespace
}  // namespace mvstudio::calib
