#include "dataset/pose/markers.h"

#include <fstream>

#include "core/error.h"
#include "core/random.h"
#include "tests/dataset/c3d_sample.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Files of 3D markers: C3D and TRC.
namespace mvstudio::dataset {
namespace {

class Markers : public ::testing::Test {
 protected:
  MarkerFile Read(const std::string& bytes, const std::string& unit = {}, const std::string& name = "a.c3d") const {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return ReadMarkers(folder_ / name, unit);
  }
  std::string Message(const std::string& bytes) const {
    return MessageOf<FormatError>([&] { Read(bytes); });
  }
  TempDir folder_;
};

C3dSample TwoPoints() {
  C3dSample sample;
  sample.first = 11;
  sample.frames = {{1000, -2000, 3000.5, 0.7, 1, 2, 3, 0}, {1500, -2500, 8.1, 0, 0, 0, 0, -1}};
  return sample;
}

/// Two points 1.7 apart in the file's unit, in three frames.
std::string TrcOfTwo(const std::string& unit, double apart) {
  std::string text = "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n60\t60\t3\t2\t" +
                     unit + "\nFrame#\tTime\ta\t\t\tb\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n";
  for (int f = 1; f <= 3; ++f) {
    text += std::to_string(f) + "\t0\t0\t0.001\t0\t0\t" + std::to_string(apart) + "\t0\n";
  }
  return text;
}

TEST_F(Markers, AUnitThatMakesGiantsOrDwarfsIsDoubted) {
  const auto conflict = [&](const std::string& unit, double apart, const std::string& read_as = {}) {
    return UnitConflict(Read(TrcOfTwo(unit, apart), read_as, "a.trc"), "a.trc");
  };
  EXPECT_EQ(conflict("mm", 1700), "");
  EXPECT_EQ(conflict("m", 1.7), "");
  EXPECT_EQ(conflict("cm", 8), "");  // a mouse
  EXPECT_THAT(conflict("m", 1700), AllOf(HasSubstr("a.trc: read in m"), HasSubstr("over 1.7e+03 m")));
  EXPECT_THAT(conflict("mm", 1.7), HasSubstr("within 0.0017 m"));
  EXPECT_EQ(conflict("m", 1700, "mm"), "");
  EXPECT_EQ(conflict("mm", 0), "");  // nothing to judge by
}

TEST_F(Markers, EveryKindOfC3dGivesTheSamePoints) {
  for (const int processor : {84, 85, 86}) {
    for (const bool floats : {true, false}) {
      for (const int analog : {0, 3}) {
        SCOPED_TRACE(std::to_string(processor) + (floats ? " floats" : " integers"));
        C3dSample sample = TwoPoints();
        sample.processor = processor, sample.floats = floats, sample.analog_per_frame = analog;
        const MarkerFile file = Read(sample.Bytes());
        ASSERT_EQ(file.pose.rows.size(), 4u);
        EXPECT_EQ(file.unit, "mm");
        EXPECT_FALSE(file.y_up);
        EXPECT_EQ(file.pose.rows[0].frame, 10);  // C3D counts from 1
        EXPECT_EQ(file.pose.rows[0].joint, "a");
        EXPECT_LT((file.pose.rows[0].x_in_world - Eigen::Vector3d(1, -2, 3.0005)).norm(), 1e-7);
        EXPECT_LT((file.pose.rows[1].x_in_world - Eigen::Vector3d(0.001, 0.002, 0.003)).norm(), 1e-9);
        EXPECT_EQ(file.pose.rows[2].frame, 11);
        EXPECT_LT((file.pose.rows[2].x_in_world - Eigen::Vector3d(1.5, -2.5, 0.0081)).norm(), 1e-7);
        EXPECT_EQ(file.pose.rows[3].status, Status::kTooFewViews);  // residual -1
      }
    }
  }
}

TEST_F(Markers, DecFloatsAreReadExactly) {
  // VAX F format: 1 is the words 4080h, 0; -0.15625 = -0.625 * 2^-2 is BF20h, 0 (VAX Architecture Reference Manual).
  C3dSample sample;
  sample.processor = 85;
  EXPECT_EQ(sample.Float(1), std::string("\x80\x40\0\0", 4));
  EXPECT_EQ(sample.Float(-0.15625), std::string("\x20\xBF\0\0", 4));
  sample.units = "m";
  Rng rng(3);
  for (int f = 0; f < 50; ++f) {
    std::vector<double> frame;
    for (int k = 0; k < 8; ++k) frame.push_back(static_cast<float>(std::ldexp(rng.Normal(), k - 4)) * (k % 4 != 3));
    sample.frames.push_back(frame);
  }
  const MarkerFile file = Read(sample.Bytes());
  for (size_t f = 0; f < 50; ++f) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      EXPECT_EQ(file.pose.rows[2 * f].x_in_world[k], sample.frames[f][static_cast<size_t>(k)]);
    }
  }
}

TEST_F(Markers, UnitsAndUpAxisComeFromTheFile) {
  C3dSample sample = TwoPoints();
  for (const auto& [unit, metres] : {std::pair<std::string, double>("m", 1), {"CM", 0.01}, {"inches", 0.0254}}) {
    sample.units = unit;
    EXPECT_NEAR(Read(sample.Bytes()).pose.rows[0].x_in_world.x(), 1000 * metres, 1e-4) << unit;
  }
  sample.y_screen = "+Y";
  sample.units = "m";
  const MarkerFile up = Read(sample.Bytes());
  EXPECT_TRUE(up.y_up);
  EXPECT_EQ(up.pose.rows[0].x_in_world, Eigen::Vector3d(3000.5, 1000, -2000));
  sample.units = "";
  EXPECT_THAT(Message(sample.Bytes()), AllOf(HasSubstr("POINT:UNITS: is missing"), HasSubstr("'marker-unit'")));
  EXPECT_NEAR(Read(sample.Bytes(), "mm").pose.rows[0].x_in_world.y(), 1, 1e-6);
  EXPECT_THAT(MessageOf<UsageError>([&] { Read(sample.Bytes(), "ell"); }), HasSubstr("expected m, cm, mm, in"));
}

TEST_F(Markers, SubjectsBecomePersonsAndNamesStayDistinct) {
  C3dSample sample = TwoPoints();
  sample.labels = {"Rat1:nose", "Rat2:nose"};
  const MarkerFile two = Read(sample.Bytes());
  EXPECT_EQ(two.pose.rows[0].person, 0);
  EXPECT_EQ(two.pose.rows[1].person, 1);
  EXPECT_EQ(two.pose.rows[1].joint, "nose");
  sample.labels = {"m", "m"};
  EXPECT_EQ(Read(sample.Bytes()).pose.rows[1].joint, "m_2");
  sample.labels = {"m"};  // fewer labels than points
  EXPECT_EQ(Read(sample.Bytes()).pose.rows[1].joint, "point_2");
}

TEST_F(Markers, DamagedC3dIsNamed) {
  const std::string whole = TwoPoints().Bytes();
  EXPECT_THAT(Message("not a c3d"), HasSubstr("is no C3D file"));
  EXPECT_THAT(Message(whole.substr(0, 600)), HasSubstr("cut off"));
  EXPECT_THAT(Message(whole.substr(0, 1024)), HasSubstr("holds none of 2 frames"));
  std::string other = whole;
  other[515] = 99;
  EXPECT_THAT(Message(other), HasSubstr("processor type 99"));
  other = whole, other[2] = 0;
  EXPECT_THAT(Message(other), HasSubstr("no 3D points"));
  EXPECT_THROW(ReadMarkers(folder_ / "none.c3d"), IoError);
}

TEST_F(Markers, ReadersSurviveDamage) {
  const std::string whole = TwoPoints().Bytes();
  Rng rng(7);
  int refused = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::string damaged = whole;
    for (int k = 0; k < 4; ++k) damaged[static_cast<size_t>(rng.Index(700))] = static_cast<char>(rng.Index(256));
    try {
      for (const JointRow& row : Read(damaged).pose.rows) ASSERT_TRUE(row.status != Status::kOk || row.x_in_world.allFinite());
    } catch (const FormatError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 30);
  EXPECT_LT(refused, 299);
}

TEST_F(Markers, TrcOfOtherProgramsAndUnits) {
  const auto text = [](const std::string& unit) {
    return "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\n60\t60\t1\t1\t" +
           unit +
           "\t60\nFrame#\tTime\tr_knee\t\t\t\n\t\tX1\tY1\tZ1\t\n\n1\t0\t100\t200\t300\t\n";  // OpenCap leaves a line empty
  };
  for (const auto& [unit, metres] : {std::pair<std::string, double>("m", 1), {"mm", 0.001}, {"cm", 0.01}, {"Meters", 1}}) {
    const MarkerFile file = Read(text(unit), {}, "a.trc");
    EXPECT_LT((file.pose.rows.at(0).x_in_world - metres * Eigen::Vector3d(300, 100, 200)).norm(), 1e-12) << unit;
    EXPECT_TRUE(file.y_up);
    EXPECT_EQ(file.unit, unit);
  }
  EXPECT_EQ(Read(text("furlong"), "m", "a.trc").pose.rows[0].x_in_world.x(), 300);
  EXPECT_THAT(MessageOf<FormatError>([&] { Read(text("furlong"), {}, "a.trc"); }), HasSubstr("`furlong` is none of"));
}

/// Four markers at (10 m + 1, 10 m + 2, 10 m + 3) m, in frames 1 and 2.
std::string TrcOfFour(const std::string& names, const std::string& head = "100\t100\t2\t4\tm") {
  std::string text = "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n" + head +
                     "\nFrame#\tTime\t" + names + "\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\tX3\tY3\tZ3\tX4\tY4\tZ4\n\n";
  for (const std::string frame : {"1\t0", "2\t0.01"}) {
    text += frame;
    for (int m = 0; m < 4; ++m) {
      for (int k = 1; k <= 3; ++k) text += "\t" + std::to_string(10 * m + k) + ".5";
    }
    text += "\n";
  }
  return text;
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  for (size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) text.replace(at, from.size(), to);
  return text;
}

TEST_F(Markers, TrcNamesKeepTheirColumns) {
  const auto names = [&](const std::string& bytes) {
    const MarkerFile file = Read(bytes, {}, "a.trc");
    std::string list;
    for (size_t m = 0; m < 4; ++m) {
      list += file.pose.rows.at(m).joint + " ";
      EXPECT_NEAR(file.pose.rows[m].x_in_world.y(), 10. * static_cast<double>(m) + 1.5, 1e-12);
    }
    return list;
  };
  const std::string clean = TrcOfFour("a\t\t\tb\t\t\tc\t\t\td\t\t");
  for (const std::string& bytes :
       {clean, TrcOfFour("a\tb\tc\td"), TrcOfFour(" a \t\tb\t\tc\t\td\t"), TrcOfFour("\ta\t\tb\t\tc\t\td"),
        TrcOfFour("a\tb\tc\td", "  100 \t\t 100\t\t 2\t\t 4\t\t m "), Replaced(clean, ".5", ",5"),
        Replaced(TrcOfFour("a\tb\tc\td"), "\t", "  "), Replaced(TrcOfFour("a\tb\tc\td"), "\t", ",")}) {
    EXPECT_EQ(names(bytes), "a b c d ") << bytes;
  }
  EXPECT_EQ(names(TrcOfFour("a\t\t\t\t\t\tc\t\t\td\t\t")), "a point_2 c d ");
  EXPECT_EQ(names(TrcOfFour("a\t\tc\td")), "a point_2 c d ");
  EXPECT_THAT(MessageOf<FormatError>([&] { Read(TrcOfFour("a\tb\tc\td\te"), {}, "a.trc"); }), HasSubstr("5 names"));
}

TEST_F(Markers, TrcNumbersAreReadWholeOrRefused) {
  const std::string clean = TrcOfFour("a\tb\tc\td");
  const auto message = [&](const std::string& bytes) { return MessageOf<FormatError>([&] { Read(bytes, {}, "a.trc"); }); };
  EXPECT_THAT(message(Replaced(clean, "\t12.5", "\t12,5")), HasSubstr("a comma"));
  EXPECT_THAT(message(Replaced(clean, "\t12.5", "\t12.5mm")), HasSubstr("`12.5mm`"));
  EXPECT_THAT(message(Replaced(clean, "\n2\t", "\n1\t")), HasSubstr("frame 1 stands in line 7"));
  EXPECT_THAT(message(Replaced(clean, "\n2\t", "\n2x\t")), HasSubstr("not a frame number"));
  for (const std::string missing : {"", "NaN", "null", "-inf", "NA"}) {
    const MarkerFile file = Read(Replaced(clean, "\t12.5", "\t" + missing), {}, "a.trc");
    EXPECT_EQ(file.pose.rows.at(1).status, Status::kTooFewViews) << missing;
    EXPECT_EQ(file.pose.rows.at(2).status, Status::kOk) << missing;
  }
}

TEST_F(Markers, TrcIsHeldAgainstItsHeader) {
  const auto notes = [&](const std::string& head) {
    return ::testing::PrintToString(Read(TrcOfFour("a\tb\tc\td", head), {}, "a.trc").notes);
  };
  EXPECT_EQ(notes("100\t100\t2\t4\tm"), "{}");
  EXPECT_THAT(notes("100\t100\t9\t4\tm"), HasSubstr("states 9 frames, 2 are there"));
  EXPECT_THAT(notes("100\t100\t2\t5\tm"), HasSubstr("states 5 markers"));
  EXPECT_THAT(notes("50\t100\t2\t4\tm"), HasSubstr("states 50 frames a second"));
}

TEST_F(Markers, C3dCountsAreHeldAgainstTheSize) {
  C3dSample sample = TwoPoints();
  const std::string whole = sample.Bytes();
  const MarkerFile cut = Read(whole.substr(0, 1024 + 32));
  EXPECT_EQ(cut.pose.rows.size(), 2u);
  ASSERT_EQ(cut.notes.size(), 1u);
  EXPECT_THAT(cut.notes[0], HasSubstr("states 2 frames and holds 1"));
  sample.first = 1, sample.frames.assign(65536 + 40, {1, 2, 3, 0, 4, 5, 6, 0});
  const MarkerFile wrapped = Read(sample.Bytes());  // the header's count is 40
  EXPECT_EQ(wrapped.pose.rows.size(), 2u * (65536 + 40));
  EXPECT_THAT(wrapped.notes.at(0), HasSubstr("began anew"));
}

/// As Plug-in Gait writes them: numbers of a model beside the markers, listed by kind.
TEST_F(Markers, AnglesAndForcesOfAModelAreNoMarkers) {
  C3dSample sample = TwoPoints();
  sample.labels = {"LKNE", "LKneeAngles"};
  for (const char* kind : {"ANGLES", "POWERS", "ODD"}) {
    sample.lists = {{kind, {"LKneeAngles"}}, {"TYPE_GROUPS", {"ANGLES", "ODD"}}};
    const MarkerFile file = Read(sample.Bytes());
    ASSERT_EQ(file.pose.rows.size(), 2u) << kind;
    EXPECT_EQ(file.pose.rows[1].joint, "LKNE");
    EXPECT_LT((file.pose.rows[1].x_in_world - Eigen::Vector3d(1.5, -2.5, 0.0081)).norm(), 1e-7);
    EXPECT_THAT(file.notes.at(0), AllOf(HasSubstr("1 of its 2 points"), HasSubstr("LKneeAngles")));
  }
  sample.lists = {{"ANGLES", {"LKneeAngles", "LKNE"}}};
  EXPECT_THAT(Message(sample.Bytes()), HasSubstr("no point is a place"));
}

TEST_F(Markers, RotationsOfSegmentsAreNoFramesOfPoints) {
  C3dSample sample = TwoPoints();
  sample.rotations = true;
  const MarkerFile file = Read(sample.Bytes());
  EXPECT_EQ(file.pose.rows.size(), 4u);
  EXPECT_TRUE(file.notes.empty()) << file.notes[0];
  sample.labels.clear(), sample.frames.clear();
  EXPECT_THAT(Message(sample.Bytes()), AllOf(HasSubstr("rotations of segments"), HasSubstr("export")));
}

TEST_F(Markers, ZerosFarFromAMarkersPathAreNotSeen) {
  C3dSample sample = TwoPoints();
  sample.frames = {{1000, 0, 900, 0, 3, 0, 0, 0}, {0, 0, 0, 0, 0, 0, 0, 0}, {1010, 0, 900, 0, -3, 0, 0, 0}};
  const MarkerFile file = Read(sample.Bytes());
  EXPECT_EQ(file.pose.rows[2].status, Status::kTooFewViews);
  EXPECT_EQ(file.pose.rows[3].status, Status::kOk) << "b passes through the origin";
  EXPECT_THAT(file.notes.at(0), HasSubstr("1 points are 0 0 0"));
}

/// Counts, rates and times that a table states, held against its rows.
TEST_F(Markers, TablesAreHeldAgainstWhatTheyState) {
  const auto notes = [&](const std::string& name, const std::string& text) {
    return ::testing::PrintToString(Read(text, {}, name).notes);
  };
  const auto refused = [&](const std::string& name, const std::string& text) {
    return MessageOf<FormatError>([&] { Read(text, {}, name); });
  };
  const auto sto = [](const std::string& head, const char* times = "0\t1,2,3\n0.01\t1,2,3\n0.02\t1,2,3\n") {
    return "DataType=Vec3\nUnits=m\n" + head + "endheader\ntime\tNose\n" + times;
  };
  EXPECT_EQ(notes("a.sto", sto("DataRate=100\nnRows=3\nnColumns=2\n")), "{}");
  EXPECT_THAT(notes("a.sto", sto("DataRate=100\nnRows=9\n")), HasSubstr("states 9 rows, 3 are there; was it cut off?"));
  EXPECT_THAT(notes("a.sto", sto("DataRate=100\nnColumns=7\n")), HasSubstr("states 7 columns, 2 are there"));
  EXPECT_THAT(notes("a.sto", sto("DataRate=30\n")), HasSubstr("states 30 rows a second, its times are those of 100"));
  EXPECT_EQ(Read(sto("DataRate=30\n"), {}, "a.sto").pose.frame_rate_hz, 100);
  EXPECT_THAT(notes("a.sto", sto("DataRate=100\n", "0.02\t1,2,3\n0\t1,2,3\n")), HasSubstr("do not rise"));
  EXPECT_THAT(refused("a.sto", sto("DataRate=100\n", "0\t1,2,3\n0\t4,5,6\n")), HasSubstr("there twice"));

  const std::string head = "frame,joint,x_m,y_m,z_m,time_s";
  EXPECT_EQ(notes("a.csv", head + "\n0,a,0,0,1,0\n1,a,0,0,1,0.1\n"), "{}");
  EXPECT_THAT(refused("a.csv", head + "\n0,a,0,0,1,0\n0,a,0,0,2,0\n"), HasSubstr("frame 0: `a` of person 0 is there twice"));
  EXPECT_THAT(notes("a.csv", head + ",unit\n0,a,0,0,1,0,mm\n1,a,0,0,1,0.1,mm\n"), HasSubstr("that are not read: unit"));
  EXPECT_THAT(notes("a.csv", head + "\n0,a,0,0,1,0\n1,a,0,0,1,0.3\n2,a,0,0,1,0.2\n"), HasSubstr("do not rise"));
  EXPECT_THAT(refused("b.csv", "frame,a_x_m,a_y_m,a_z_m\n0,0,0,1\n0,0,0,2\n"), HasSubstr("there twice"));
}

/// Rows that a program left out are gaps of the times, not of the row count.
TEST_F(Markers, GapsOfTimesAreGapsOfFrames) {
  const std::string rows[] = {"0.0", "0.1", "0.2", "0.6", "0.7"};
  std::string wide = "time,a_x_m,a_y_m,a_z_m\n", sto = "DataType=Vec3\nUnits=m\nendheader\ntime\ta\n";
  for (const std::string& time : rows) wide += time + ",0,0,1\n", sto += time + "\t0,0,1\n";
  for (const auto& [name, text] : {std::pair("a.csv", wide), {"a.sto", sto}}) {
    const MarkerFile file = Read(text, {}, name);
    EXPECT_NEAR(file.pose.frame_rate_hz, 10, 1e-9) << name;
    ASSERT_EQ(file.pose.rows.size(), 5u) << name;
    EXPECT_EQ(file.pose.rows[3].frame, 6) << name;
    EXPECT_EQ(file.pose.rows[4].frame, 7) << name;
  }
}

}  // namespace
}  // namespace mvstudio::dataset
