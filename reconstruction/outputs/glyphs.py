"""Letters of DejaVu Sans as grey levels; made by tools/glyphs.py.

DejaVu changes to Bitstream Vera are in the public domain; Bitstream Vera is a trademark of
Bitstream, Inc., copyright (c) 2003 by Bitstream, Inc., free to use, embed and redistribute.
"""

import base64
import zlib
from functools import cache

import numpy as np

from ..arrays import Floats

HEIGHT = 17
"""Of a line, in pixels."""
LETTERS = "".join(map(chr, range(32, 127))) + "×°²³¹⁰⁴⁵⁶⁷⁸⁹⁻±µλσ–—’…"
WIDTHS = (
    "466c9db4557c4545999999999955ccc7eaaab98bb4498cab8ba99aaea9a555c77998995994484e999967598b8879"
    "59cc766666666667c9897e4e"
)
"""Of each letter in pixels, a hexadecimal digit."""
_PACKED = (
    "c-rlmdvH|M9ml_S_wM8FD;H2=kYv}XeQ8aWX>G@WlIxV|V~}LgYNyp<*FUtj6<DW^&Nu=~wOVQu7HG!`hU|=XFe>p<kR"
    "|~ns0g(KY={CuhAazt(2$tTOQ=b1f9KrIzHliiZKvaK!rXKB+;i?d=X`#@@A;hra5Y^`SJUSwMRE&-xD@()5BbmlUEUZ"
    "<7d)BF8`4E}dbY8jUF{)WQpYRQUD?N%4PY+Bu|WPB!VlS1oae!<-fQM5!riiPS56hn-{nhv;}~o!6M!3W9q@uK2#0~2d"
    "g-gLKnfYCyg8@M3s^kr!}LQw80&kyC_1^93YSK(LK~-+eQVIJX%V4nEQF%=ck+E$Ja`l^zty{v?#t;5wHm#O8f{~D0Z5"
    "uQN_UzfRE@tUODe<xY~X)lH~oTi0a&d{=OHHW)%G?I)jcK~YR1-5%dwU8qH~WFXqtAx5r(OM2VfXl0-U4F5kYbIb)fP)"
    "8vDdPd`KN2z?Fyfe%XV00Gr~NJYf5!{6iQ40fse}U3`6y>>u@(jrrW4!2Y8U$`$8>Ug>Gy^oP`$_o!d{elX`Xr5729aq"
    "uF*_Zg!QYDNR-DD~Q?!H%hG7+|*t4W>1F{*WFwOCN|Mg@gE6xexY*MR7cH!%_vt6A^Cw!tom(psdU%wTfNXJZp(3-_X5"
    "&#qhV=jnxY9BDv89%!uKZt-^e|yY?e6h;#?svTe$3flR>uAP0O>Mz1Q3%VNUN<Gndf4=Tc?TMch{Bvm{M+dESqC!+&6V"
    "7~{}Xqh5@ESvicov4vZg2FMz>=OdKiUT%w@6sJXIGhKtr8yhfl>;^maKK`JcJZ@?AxL3ZBX|}+KoqYj&bu&s9*x;|v(W"
    "rgB<<lZ6ZNgR4hVD0MSy=}i9mY$rM1SGEpQ(dcd}=%U@_?5{2nC>urX$j;C-OL$9|C&!Wl&Id>yd$6t7badl*f^FdXR-"
    "-m4@vWu2ZE_=?GtjByBO8W>DMxEVUuvS11@FUkOH9^vq%odMHvRoWRA6SgRDoE}M0s_Tr<(<&5jtDXSt3c(e01}(4qY$"
    "}#~aS*0KiOtH~2mxNe0nZKE_DpnC(t12-tnVfb9aXTgtqzv<BX~oL7WJ+V+t>GnlO9~*t3y+LH&eUD`m;1>s?D3RCXMy"
    "#9lgO?t$!bEVN#D*D^M1;Zs|h#Ju%o`*0fJA25eJc3F28x2sWQ_+)IET!XE2v#qyKTq6byXgmtHH&NmaLyYKesfZ4lY8"
    "h}u*X&D}9%kb%=46uRJN{cvx5rSvCzm<w#(*eIq^6AM1Y>Bu6G>1B1VhCZ07cUU>6@6Rb4D&kOFt>^w3~;k40Y5p1q57"
    "<BW#3VZyZ3QtsgYL+8;`_(4pVdy_u#1TNfNNFc>=IrlmU2!PY1lc+5UtoZ5t31ZtB_!nE<y?T}y(VR>Kv}1Z<7M@3E=&"
    "hr+HP>~B&17yVv(_X##dF1i~czt+dBr=lo!KT;92c1#OfTd%u-WwR=L<iRzwR)_5)(>is)rZaTiy|A+5+5zmoe{O(k4("
    "QETlil|Vol~D84`vYDiqPTqE{QsVm9yG}4!9K<x+VY{6DiL-gXLZ((RiMIH0vJxEjvwrbUxn3Gx#xDjE_dedGj&>+s{L"
    "4EgZ@t6GwGjO1L~!i`L+d(%YUo8APqlsga!N)?A5p1l&F>PXe~Jz^Dzw)IxwCm|E{Cc#c*;@(@}f$)<MBS{l^>Pd~Ih6"
    "$==a{e${!JB-8DKi?cHp?AA{w1$p*jl)U6))=k97pQDhFQQ+X4!Cw0I^Zp*%VwyO+9W1usX(QdBzhe^69*;L*bP(PCQl"
    "l$VF){5?k~8JbQ*?HdSNlM8+)8jQIM~}*=Z0vVTqQIC(u~ia0V9D(oFX14AVI4bim6Mx;B9p^&^zo!ZaWIc{AQ*2j`ar"
    "Y>Sv;j^L(*+iPuWp;3@W7e{bij04tfn5X66JI(VMfh6FWw?<ZLgExLT;`n+qS}^+yQSmFB#A=$6Asuk}0oKX)^8kKNHy"
    "xFPN~roYKta~Gi|;%wy>py(f&=zakfpm`vWZ*H09?&HVX3dwYiA+2GgL4<t&MpgtgY8{qNuMfsz)fjzsmgTZM`0n2E-h"
    "S7%M=T$Ewn(3*(u9lO9Y(E=^5)@QWv89kBYxCu~$+{*5GH3bLl@fJuyiYimZ*fYD?arub@skf1@C#|gcK$zrXS0j7z}0"
    "c@<Nxof2Gjk?IX*=VHEM=j090h&)jww?ptH3%-$4#uznQl!j7{Yy4$WJ~m}r{yGI(<yt{s<ysa0knHjF7F3kmqpFT0b}"
    "U^1*(6V`g`gY=`u@xP4$l|E-h+!jEqDn{56EfWdlVzk9*9IBE1H4z%}JcxrZ-jd6SC<Fh=>CU37W36wkYrnOj%@!6iB)"
    "xb$meS`Q;F(bh9u^Ho2+fhyV~&In`g4$z{<>d>PMz$rUnfGeQ`p2Mt>(L;A0iMC|`-Y|1d5^%+btlYLOCDFVtlV}sSlZ"
    "_lO*`2u`{z7t=W52~-lHt-{5K$_Fd4x}qkjMq>T#MmszymzUqRgHK+;lbvaCt6Z@pp%lfYISr#CUAgb1;1DgX5P2u#$S"
    "DJXpqKQy%UOrU740ngA?}IKpIG>rI+A%rH=Pab>4>FW(2#ELp+~uus^<q9q<=W$hj)Z9+Q8TF%|tuJV~=9&F=)m&-{bK"
    "uNOQ^h0mvNHisq=<82^fDYDM1~^ZUl?7NhAnSmgF;;Fkp9->gT^?jrvrjFR8DJ?2il<5zQ>?dPJ64eezb|y@fXl;tikO"
    "IH11|HBZe&U{Yk>)go&elX8p;NoEzvv*-%o5Cn2Kyz4B>*hU>_Wt;xM<V@Y4(!bJyUML|-o8{bX^Ls5wTHy+7|hm~W++"
    "8QT`VL@V+wvh&W<whyMRX4?g}O-chcC3t*%8ho3?09%*?zdVHk9|rhkT7!*TqM1s!Ueish@=jy~SxE)leU#l%Aq81Sd%"
    "Wzm%a}wDrnX5Z<n%V_-6?Z20b^#14mb(EmTi-6iu1a(O{%AD5=uh$JEwibJ=k!5$|BlTf9&B(STP7|3k6&Zu%QP!;3sk"
    "cyH?H_&JMDw7k()?5oDzR8@jUrTU!e=f~*D@*BLvlTTpewiZCi^o(}~J22myNfS?78ou9Q$(u1r?qyw}35m!*?pf8@v-"
    "Y6v~2yh2dfbSKfZ0Q*zJKqcOWC+W~*KVdck-~;}8Zh4pR<o+?prcaL!UdXk9`pOQfdii1_Y!aiy+j;jD>^&q=v%`8Klx"
    "ePBm!I<KvKoalv?eaFZ-ZloI?|;#`k9(bO;CN*{3PMCG4Q%tiA>rYBVn3=2PNkc7j5HsZ%6QMiy9=Md6O2QehDS0X8!="
    "V}R%80v6kkcBHmR!p5_8Ft@kKH2R{x4H<w@8p;Bk+9vTP<QNb4h71S$XVBgXP8M}~?J;qPX<EH(zQi`^vXUNT{q^AXu0"
    "=Afq}8L|Jb)*2RO#S^tl>!?$-SFzr+@tRY3nERqNaaU!5W|ZQKeIPW9V|LJA)UWWM-v?tkcarsWF)+PqL!__F3n?D?N+"
    ";%rW}@b0@)t2hXjWM0GA~|3b9nNq0iJY>WNwl<MTcoN(j{0E-hRiHr5KXy5+~@c(;q{g?megJiG&QqPM{Zk^~!<O%?v%"
    "#h)^SJdIp8{n&HlIfqMHR_)"
)
"""All letters side by side, two pixels in a byte, compressed."""


@cache
def _glyphs() -> dict[str, Floats]:
    packed = np.frombuffer(zlib.decompress(base64.b85decode(_PACKED)), np.uint8)
    levels = np.stack([packed >> 4, packed & 15], axis=-1).reshape(HEIGHT, -1)
    ends = np.cumsum([int(width, 16) for width in WIDTHS])
    parts = np.split(levels[:, : ends[-1]] / 15, ends[:-1], axis=1)
    return dict(zip(LETTERS, parts, strict=True))


def written(text: str) -> Floats:
    """How much of each pixel a line of text covers, 0..1: (HEIGHT, width)."""
    glyphs = _glyphs()
    return np.hstack([glyphs[" "][:, :0], *(glyphs.get(each, glyphs["?"]) for each in text)])
