#pragma once
// g++ then leaves the steps of these macros out of its errors: 2000 lines for a misspelt field
#pragma GCC system_header

// Calls a macro for every argument: O80_FOR_EACH(M, fixed, a, b) => M(fixed, a) M(fixed, b).
// Up to 256 arguments, by rescanning (C++20 __VA_OPT__).

#define O80_PARENS ()
#define O80_EXPAND(...) O80_EXPAND_3(O80_EXPAND_3(O80_EXPAND_3(O80_EXPAND_3(__VA_ARGS__))))
#define O80_EXPAND_3(...) O80_EXPAND_2(O80_EXPAND_2(O80_EXPAND_2(O80_EXPAND_2(__VA_ARGS__))))
#define O80_EXPAND_2(...) O80_EXPAND_1(O80_EXPAND_1(O80_EXPAND_1(O80_EXPAND_1(__VA_ARGS__))))
#define O80_EXPAND_1(...) O80_EXPAND_0(O80_EXPAND_0(O80_EXPAND_0(O80_EXPAND_0(__VA_ARGS__))))
#define O80_EXPAND_0(...) __VA_ARGS__

#define O80_FOR_EACH(macro, fixed, ...) \
  __VA_OPT__(O80_EXPAND(O80_FOR_EACH_STEP(macro, fixed, __VA_ARGS__)))
#define O80_FOR_EACH_STEP(macro, fixed, first, ...) \
  macro(fixed, first) __VA_OPT__(O80_FOR_EACH_AGAIN O80_PARENS(macro, fixed, __VA_ARGS__))
#define O80_FOR_EACH_AGAIN() O80_FOR_EACH_STEP

// 1 if the argument is in parentheses, else 0
#define O80_IS_GROUP(x) O80_SECOND(O80_IS_GROUP_PROBE x, 0, ~)
#define O80_IS_GROUP_PROBE(...) ~, 1
#define O80_SECOND(...) O80_SECOND_OF(__VA_ARGS__)
#define O80_SECOND_OF(first, second, ...) second

#define O80_JOIN(a, b) O80_JOIN_NOW(a, b)
#define O80_JOIN_NOW(a, b) a##b
